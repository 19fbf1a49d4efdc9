"""The analytic model: joint springs, influence coefficients, platform stiffness, exact equilibrium."""
