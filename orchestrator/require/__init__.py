"""Requirements: which design is the cheapest that surely suffices, with runs where they decide.

>>> from sblcosim import require                       # doctest: +SKIP
>>> require.decide("one-metre", "answers/one-metre")   # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import lazy

if TYPE_CHECKING:
    from .answer import Answer
    from .question import Question, load, shipped
    from .run import decide

__all__ = ["Answer", "Question", "decide", "load", "shipped"]

if not TYPE_CHECKING:  # a checker would take any name for one of ours
    _get, __dir__ = lazy.names(
        __name__,
        {
            "Answer": "answer", "Question": "question", "load": "question",
            "shipped": "question", "decide": "run",
        },
    )  # fmt: skip
    __getattr__ = _get
