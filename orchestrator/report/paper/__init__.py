"""The report on the paper's study: `sblcosim paper`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import lazy

if TYPE_CHECKING:
    from .campaigns import SCENARIOS, SESSIONS, progress_of
    from .numbers import PRACTICAL, facts, pooled, pooled_intervals, verdict
    from .page import PaperReport, run

__all__ = [
    "PRACTICAL", "SCENARIOS", "SESSIONS", "PaperReport", "facts", "pooled",
    "pooled_intervals", "progress_of", "run", "verdict",
]  # fmt: skip

__getattr__, __dir__ = lazy.names(
    __name__,
    {
        "PaperReport": "page", "PRACTICAL": "numbers", "SCENARIOS": "campaigns",
        "SESSIONS": "campaigns", "facts": "numbers", "pooled": "numbers",
        "pooled_intervals": "numbers", "progress_of": "campaigns", "run": "page",
        "verdict": "numbers",
    },
)  # fmt: skip
