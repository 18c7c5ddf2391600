"""What a study's table says: effects, intervals, advice, and their figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .advice import Advice, advise
    from .factorial import Factorial, analyse
    from .saving import save, save_advice
    from .study_advice import advice_on_study
    from .workflow import of_study, of_table

__all__ = [
    "Advice", "Factorial", "advice_on_study", "advise", "analyse", "of_study", "of_table", "save",
    "save_advice",
]  # fmt: skip

if not TYPE_CHECKING:  # a checker would take any name for one of ours
    __getattr__, __dir__ = lazy.names(
        __name__,
        {
            "Advice": "advice", "Factorial": "factorial", "advice_on_study": "study_advice",
            "advise": "advice", "analyse": "factorial", "of_study": "workflow",
            "of_table": "workflow", "save": "saving", "save_advice": "saving",
        },
    )  # fmt: skip
