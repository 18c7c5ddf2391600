"""What the receivers of a run assumed or learned about the diver's motion, and whether it fits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sblcosim.models import RECEIVERS

from ..data.motion import motion_psd
from ..data.record import Record
from ..words.lists import listed, plural

LIVELIER = 4.0
"""A receiver is told if q of the path is more than this many times its own."""
LEARNED = "learned_psd_m2_s3"
"""In the origin of an estimator after the run: ``median`` and ``last`` of what it learned."""
_PSD = "acceleration_psd"


@dataclass(frozen=True)
class Motion:
    """q of the diver's motion for a receiver: density of the white acceleration [m²/s³].

    Attributes
    ----------
    assumed
        The number that it was given; None: it learned q.
    median, last
        What it learned: over its updates, and at the last one. None: it does not say.
    """

    assumed: float | None
    median: float | None = None
    last: float | None = None

    def to_json(self) -> dict[str, Any]:
        """The result as plain data."""
        return {
            "assumed_m2_s3": self.assumed, "median_m2_s3": self.median, "last_m2_s3": self.last,
        }

    def __str__(self) -> str:
        name = "q of the diver's motion"
        if self.assumed is not None:
            return f"{name}: {self.assumed:g} m²/s³ assumed"
        if self.median is None or self.last is None:
            return f"{name}: learned"
        return (
            f"{name}: learned, {self.median:.2g} m²/s³ in the median and {self.last:.2g} m²/s³ at "
            "the end"
        )


def motions(
    origins: Mapping[str, Mapping[str, Any]], record: Record, receivers: Sequence[str]
) -> dict[str, Motion]:
    """What is known of each receiver's q; nothing of one that has none.

    Parameters
    ----------
    origins
        Origin of each receiver, with the parameters that it was given.
    """
    found = {}
    for receiver in receivers:
        given = origins.get(receiver, {}).get("parameters", {}).get(_PSD)
        if isinstance(given, int | float) and given >= 0:
            found[receiver] = Motion(float(given))
            continue
        told = origins.get(receiver, {}).get(LEARNED)
        learned = motion_psd(record, receiver)
        if told is not None:
            found[receiver] = Motion(None, told["median"], told["last"])
        elif learned is not None:
            found[receiver] = Motion(None, float(np.median(learned)), float(learned[-1]))
        elif given is not None:
            found[receiver] = Motion(None)
    return found


def too_lively(
    motion: Mapping[str, Motion], origins: Mapping[str, Mapping[str, Any]], path_psd: float
) -> Iterator[str]:
    """Whether the diver turns more than receivers assume that could learn how the diver moves.

    Parameters
    ----------
    path_psd
        q of the path [m²/s³].
    """
    told: dict[float, list[str]] = {}
    for receiver, it in motion.items():
        component = RECEIVERS.get(origins.get(receiver, {}).get("type", ""))
        learns = component is not None and any(v.name == _PSD and v.named for v in component)
        if learns and it.assumed is not None and path_psd > LIVELIER * it.assumed:
            told.setdefault(it.assumed, []).append(receiver)
    for assumed, names in told.items():
        yield (
            f"the diver turns more than {listed(names)} {plural(len(names), 'assumes', 'assume')}: "
            f"q of the path is {path_psd:.2g} m²/s³, not {assumed:g} m²/s³; use "
            'acceleration_psd_m2_s3 = "learned"'
        )
