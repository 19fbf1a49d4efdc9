"""Regression: what flexfem prints of an input file against what we once accepted, and the reason why we did.

A baseline is ours, not the truth: it says that a number moved, never that it was right.
"""
