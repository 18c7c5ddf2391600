"""Analyses of a study's table: effects, intervals, advice, and their figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .advice.advice import Advice, advise
    from .advice.of_study import advice_on_study
    from .two_level.analysis import Factorial, analyse
    from .workflow import of_study, of_table

__all__ = [
    "Advice", "Factorial", "advice_on_study", "advise", "analyse", "of_study", "of_table",
]  # fmt: skip

if not TYPE_CHECKING:  # a type checker would accept any name
    __getattr__, __dir__ = lazy.names(
        __name__,
        {
            "Advice": "advice.advice", "Factorial": "two_level.analysis",
            "advice_on_study": "advice.of_study", "advise": "advice.advice",
            "analyse": "two_level.analysis", "of_study": "workflow", "of_table": "workflow",
        },
    )  # fmt: skip
