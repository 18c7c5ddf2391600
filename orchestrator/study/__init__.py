"""Studies: designs, runs, and where they are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .runner import replay
    from .store import study_of, table
    from .study import Study, load, shipped

__all__ = ["Study", "load", "replay", "shipped", "study_of", "table"]

__getattr__, __dir__ = lazy.names(
    __name__,
    {
        "Study": "study", "load": "study", "replay": "runner", "shipped": "study",
        "study_of": "store", "table": "store",
    },
)  # fmt: skip
