"""How far two computations of one number may differ on any processor; tests that compare two
solutions use these.

A processor adds in its own order and fuses its own products, so that every sum differs by some
1e-16 of its terms. A solution differs by this times the condition number of its equations. Results
that must be identical, such as the text of a file or a resumed run, are compared without a
tolerance."""

from __future__ import annotations

SUMS = 1e-12
"""Of the largest term, without equations: sums of up to some thousand products, rotations,
interpolations.
"""
DENSE = 1e-8
"""Networks of rigid or elastic parts: condition numbers up to 1e6 for unlike units and slender
hinges, with room.
"""
SOLVED = 1e-7
"""Finite elements: condition numbers of 1e6 to 1e10. Refinement ends when forces and energy balance
to 1e-10, and another processor may need one step less; stresses and differences of displacements
lose up to three digits more. """
