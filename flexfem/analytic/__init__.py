"""The analytic model: networks of bodies and hinges, and beams with finite rotations."""
