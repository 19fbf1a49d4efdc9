"""Functions and classes by their names in tables, imported when they are needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def named(place: str) -> Any:
    """Return what a module under `flexfem` defines, such as "questions.stiffness.stiffness"."""
    module, _, name = place.rpartition(".")
    return getattr(import_module(f"flexfem.{module}"), name)
