"""Hinges: formulas of compliance with sources, charts by finite elements, strength."""
