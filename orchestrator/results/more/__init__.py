"""Responses and figures of a run, each in its own file: modules of this folder are found.

A module may have ``RESPONSES``, rows with the name, the words and the function of a
`sblcosim.results.responses.Run`, and ``FIGURES``, rows of `sblcosim.catalogue.Figure`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

from sblcosim.models.found import modules_of

FOUND: Mapping[str, ModuleType] = modules_of(__name__)


def rows(what: str) -> list[Any]:
    """The rows of all modules under this name, in the order of the modules' names."""
    return [row for module in FOUND.values() for row in getattr(module, what, ())]
