"""Numbers of a page: whole millimetres and milliseconds, packed.

A page holds columns of integers of 32 bits. In a column, each integer is replaced by its difference
to the one before it (modulo 2³²), zigzag-coded: 2 d for d ≥ 0, −2 d − 1 for d < 0. The lowest bytes
of all columns come first, then the next bytes, and so on, as most of the high ones are 0. All of
them are compressed with zlib, and written as base64. ``js/data.js`` reads them.
"""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping

import numpy as np

from ..data.estimates import Floats, Integers

MISSING = -(2**31)
"""Stands for what is not known."""
_LARGEST = 2**31 - 1


def milli(values: Floats) -> Integers:
    """Thousandths of a unit, rounded; `MISSING` for NaN; what is too large is the largest."""
    known = np.isfinite(values)
    whole = np.rint(np.clip(np.where(known, values, 0.0) * 1000, -_LARGEST, _LARGEST))
    return np.where(known, whole.astype(np.int64), MISSING)


def packed(columns: Mapping[str, Integers]) -> str:
    """Columns of integers of 32 bits as a text."""
    steps = [np.diff(column, prepend=0) for column in columns.values()]
    d = np.concatenate([np.zeros(0, np.int64), *steps]).astype(np.uint32).astype(np.int32)
    zigzag = ((d << 1) ^ (d >> 31)).astype("<i4")
    shuffled = zigzag.view(np.uint8).reshape(-1, 4).T.tobytes()
    return b64encode(zlib.compress(shuffled, 9)).decode()


def unpacked(text: str, sizes: Mapping[str, int]) -> dict[str, Integers]:
    """The columns, from their text and the number of rows of each, in the order of the text."""
    shuffled = np.frombuffer(zlib.decompress(b64decode(text)), np.uint8)
    zigzag = shuffled.reshape(4, -1).T.copy().view("<u4")[:, 0]
    d = (zigzag >> 1).astype(np.int32) ^ -(zigzag & 1).astype(np.int32)
    ends = np.cumsum([*sizes.values()])
    each = np.split(d.astype(np.int64), ends[:-1]) if len(ends) else []
    return {
        name: np.cumsum(steps).astype(np.uint32).astype(np.int32).astype(np.int64)
        for name, steps in zip(sizes, each, strict=True)
    }
