"""Verification and design of planar flexure-hinge stages: an analytic model against finite elements."""

__version__ = "0.1.0"
