"""Times of a source as whole nanoseconds, exactly as they are written."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import compute
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Integers

MISSING = -(2**63)
"""Marks a value that is no time."""
LATEST = 2**62
"""Times are nearer to 0 than this [ns], some 146 years, so that their differences are exact."""
UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": SECOND}
"""Units of times by the ends of the names of their columns [ns]."""
_NUMBER = re.compile(r"[+-]?\d+", re.ASCII)
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?", re.ASCII)
_ISO = re.compile(
    r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,12}))?\s*(Z|z|[+-]\d\d(?::?\d\d)?)?",
    re.ASCII,
)


def whole(values: Any) -> Integers:
    """Whole nanoseconds, exactly; `MISSING` for values that are none."""
    return scaled(values, 1)


def scaled(values: Any, unit: int) -> Integers:
    """Whole nanoseconds of times in a unit [ns], rounded; `MISSING` for values that are none."""
    if unit == 1 and isinstance(values, pd.Series):
        given = fast(values)
        values = given if given.dtype.kind in "iu" else values  # as floats they were not exact
    if getattr(values, "dtype", None) is not None and values.dtype.kind in "iu" and unit == 1:
        given = np.asarray(values)
        within = (given < LATEST) & (given > -LATEST)
        return np.where(within, given, MISSING).astype(np.int64)
    return np.array([_scaled(value, unit) for value in values], np.int64)


def fast(values: Any) -> Any:
    """A column of words as numbers if all of them are numbers or empty; else as it is."""
    if values.dtype != object or not len(values) or {*map(type, values.to_numpy())} != {str}:
        return values
    for kind in (pa.int64(), pa.float64()):
        with suppress(ValueError):  # no such numbers, or no text
            words = pa.array(values.to_numpy(), pa.string())
            if kind == pa.float64():
                words = compute.if_else(compute.equal(words, ""), None, words)
            elif compute.any(compute.match_substring(words, "x", ignore_case=True)).as_py():
                return values  # hexadecimal
            words[:1].cast(kind)  # fails at once where a whole column takes long to fail
            return pd.Series(words.cast(kind).to_numpy(zero_copy_only=False), values.index)
    return values


def _scaled(value: Any, unit: int) -> int:
    if isinstance(value, bool | np.bool_):
        return MISSING
    if isinstance(value, str):
        text = value.strip()
        if unit == 1 and _NUMBER.fullmatch(text) and len(text) <= 20:
            return _near(int(text))
        if len(text) > 40 or not _DECIMAL.fullmatch(text):
            return MISSING
        exact = Decimal(text)
    elif isinstance(value, int | np.integer):
        return _near(int(value) * unit)
    elif isinstance(value, float | np.floating):
        exact = Decimal(repr(float(value)))
    else:
        return MISSING
    return _of_decimal(exact, unit)


def _of_decimal(exact: Decimal, unit: int) -> int:
    try:
        number = exact * unit
        if not number.is_finite() or abs(number) >= LATEST:
            return MISSING
        nearest = int(number.to_integral_value())
    except InvalidOperation:
        return MISSING
    return _near(nearest) if unit > 1 or number == nearest else MISSING


def _near(number: int) -> int:
    return number if abs(number) < LATEST else MISSING


def of_date(text: Any, *, zone: bool = True) -> int:
    """Nanoseconds since 1970 of a date and time as in ISO 8601; `MISSING` if it is none.

    Parameters
    ----------
    zone
        Whether it must have a zone; without one, it is taken as UTC.
    """
    found = _ISO.fullmatch(text.strip()) if isinstance(text, str) else None
    if found is None or (zone and not found[4]):
        return MISSING
    try:
        moment = datetime.fromisoformat(f"{found[1]}T{found[2]}").replace(tzinfo=UTC)
    except ValueError:
        return MISSING
    ahead = timedelta(0)
    if found[4] and found[4] not in "Zz":
        digits = found[4][1:].replace(":", "").ljust(4, "0")
        ahead = timedelta(hours=int(digits[:2]), minutes=int(digits[2:]))
        ahead = -ahead if found[4][0] == "-" else ahead
    since = moment - datetime(1970, 1, 1, tzinfo=UTC) - ahead
    seconds = since.days * 86_400 + since.seconds
    fraction = round(Decimal(f"0.{found[3] or 0}") * SECOND)
    return _near(seconds * SECOND + fraction)


def of_dates(values: Iterable[Any]) -> Integers:
    """`of_date` of each value."""
    return np.array([of_date(value) for value in values], np.int64)


def date_of(time_ns: int) -> str:
    """Date and time of nanoseconds since 1970, as people read it."""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=time_ns // 1000)
    return f"{moment:%Y-%m-%d %H:%M:%S} UTC"


def in_nanoseconds(table: pd.DataFrame) -> pd.DataFrame:
    """A table in which times in other units, or as dates, are whole nanoseconds, too."""
    added = {}
    for name in ("time", "arrival", "epoch"):
        if f"{name}_ns" in table:
            continue
        unit = next((unit for unit in UNITS if f"{name}_{unit}" in table), None)
        if unit is not None:
            added[f"{name}_ns"] = scaled(table[f"{name}_{unit}"], UNITS[unit])
        elif name in table:
            added[f"{name}_ns"] = of_dates(table[name])
    return table.assign(**added) if added else table


NAMES = [f"{name}_{unit}" for name in ("time", "arrival", "epoch") for unit in UNITS]
NAMES += ["time", "arrival", "epoch"]
"""Names of columns with times."""
