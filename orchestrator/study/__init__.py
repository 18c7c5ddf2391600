"""Studies: designs, runs, and their storage."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .again import replay
    from .store import table
    from .study import Study, load, shipped, study_of

__all__ = ["Study", "load", "replay", "shipped", "study_of", "table"]

if not TYPE_CHECKING:  # a checker would accept any name as one of ours
    __getattr__, __dir__ = lazy.names(
        __name__,
        {
            "Study": "study", "load": "study", "replay": "again", "shipped": "study",
            "study_of": "study", "table": "store",
        },
    )  # fmt: skip
