"""Verification and design of planar flexure-hinge stages: an analytic model against finite elements."""
