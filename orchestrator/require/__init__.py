"""Requirements: the cheapest design that surely suffices, with runs where they decide.

>>> from sblcosim import require                       # doctest: +SKIP
>>> require.decide("one-metre", "answers/one-metre")   # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .question import Question, load, shipped
    from .result import Requirement
    from .run import decide

__all__ = ["Question", "Requirement", "decide", "load", "shipped"]

if not TYPE_CHECKING:  # a type checker would accept any name
    _get, __dir__ = lazy.names(
        __name__,
        {
            "Question": "question", "Requirement": "result", "load": "question",
            "shipped": "question", "decide": "run",
        },
    )  # fmt: skip
    __getattr__ = _get
