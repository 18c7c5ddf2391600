"""Objects with the user's code in them, as bytes for another process."""

from __future__ import annotations

import io
from collections import ChainMap
from types import CodeType
from typing import Any, ClassVar

import cloudpickle


def packed(thing: Any) -> bytes:
    """An object by value, whose code still names its file; ``cloudpickle.loads`` unpacks it.

    cloudpickle 3.1.3 leaves out the file, which messages about exceptions name.
    """
    stream = io.BytesIO()
    _Pickler(stream).dump(thing)
    return stream.getvalue()


def _reduced(code: CodeType) -> tuple[Any, ...]:
    _, parts = cloudpickle.Pickler.dispatch_table[CodeType](code)
    return _code, (code.co_filename, *parts)


def _code(file: str, *parts: Any) -> CodeType:
    return CodeType(*parts).replace(co_filename=file)


class _Pickler(cloudpickle.Pickler):  # type: ignore[misc]
    dispatch_table: ClassVar = ChainMap({CodeType: _reduced}, cloudpickle.Pickler.dispatch_table)
