"""The report on the paper's study: `sblcosim paper`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ... import lazy

if TYPE_CHECKING:
    from .campaigns import FAVOURABLE, SCENARIOS, SESSIONS, progress_of
    from .comparisons import beside, verdict
    from .numbers import PRACTICAL, facts, facts_of_figure, pooled, pooled_intervals
    from .page import PaperReport, run

__all__ = [
    "FAVOURABLE", "PRACTICAL", "SCENARIOS", "SESSIONS", "PaperReport", "beside", "facts",
    "facts_of_figure", "pooled", "pooled_intervals", "progress_of", "run", "verdict",
]  # fmt: skip

__getattr__, __dir__ = lazy.names(
    __name__,
    {
        "FAVOURABLE": "campaigns", "PRACTICAL": "numbers", "PaperReport": "page",
        "SCENARIOS": "campaigns", "SESSIONS": "campaigns", "beside": "comparisons",
        "facts": "numbers", "facts_of_figure": "numbers", "pooled": "numbers",
        "pooled_intervals": "numbers", "progress_of": "campaigns", "run": "page",
        "verdict": "comparisons",
    },
)  # fmt: skip
