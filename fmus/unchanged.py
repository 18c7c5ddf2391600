"""Answers that are computed once while no file changes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

T = TypeVar("T")

_ANSWERS: ContextVar[dict[Hashable, Any] | None] = ContextVar("answers", default=None)
answers = _ANSWERS.get
"""The answers so far, by their questions; None where nothing is assumed."""


@contextmanager
def assumed() -> Iterator[None]:
    """Inside this context, files are assumed to stay unchanged and are examined once."""
    token = _ANSWERS.set({})
    try:
        yield
    finally:
        _ANSWERS.reset(token)


def once(question: Hashable, answer: Callable[[], T]) -> T:
    """The answer to a question about files, kept while they are assumed unchanged."""
    known = answers()
    if known is None:
        return answer()
    try:
        return known[question]  # type: ignore[no-any-return]
    except KeyError:
        pass  # computing the answer may take long, and raise
    return known.setdefault(question, answer())  # type: ignore[no-any-return]
