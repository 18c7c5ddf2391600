"""Answers that are computed once while no file changes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")

_ANSWERS: ContextVar[dict[Hashable, object] | None] = ContextVar("answers", default=None)


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
    answers = _ANSWERS.get()
    if answers is None:
        return answer()
    try:
        return answers[question]  # type: ignore[return-value]
    except KeyError:
        pass  # computing the answer may take long, and raise
    return answers.setdefault(question, answer())  # type: ignore[return-value]
