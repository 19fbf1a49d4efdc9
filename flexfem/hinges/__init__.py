"""Hinges: compliance formulas with their sources, charts by finite elements, strength of the necks."""
