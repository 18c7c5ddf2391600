"""Yardsticks for estimators, only in Python."""

from __future__ import annotations

from .estimation.particles import particle_filter

__all__ = ["particle_filter"]


def __dir__() -> list[str]:
    return __all__
