"""What must be known of a log before its receivers run, as sentences."""

from __future__ import annotations

from math import hypot

import numpy as np
from sblcosim.models import RECEIVERS

from ..scenario.sources import Choice
from ..words.lists import counted, listed
from ..words.numbers import meters, rounded
from .playing import Played
from .running import doubts_of
from .settings import Settled, drift_of

_CARRIERS = {
    "platform": "beacons on one platform, whose pose the packets report",
    "fixed": "fixed beacons",
    "buoys": "beacons that move on their own, as below buoys",
}
_ALIKE = 3.0
"""Resemblance of residuals from which claims are doubted. That of simulated dives is 2.8 at most:
their errors are independent, but offsets of beacons make residuals alike, too."""
_SPREAD = 2.0
"""Spread of a platform's reported positions over what its settings explain, from which it is
told."""
_SAME = 100
"""Number of equal readings of depth that no sensor gives."""


def remarks(ready: Settled, choice: Choice, given: Played) -> list[str]:
    """Where the settings are from, what carries the beacons, and what had to wait."""
    lines = [f"{ready.said}; {_CARRIERS[ready.arrangement]}"]
    if ready.platform is not None:
        with_platform = [
            label for label, source in choice.receivers.items()
            if isinstance(source, str) and "beacon_offset" in {v.name for v in RECEIVERS[source]}
        ]
        if with_platform:
            lines.append(
                f"{listed(with_platform)}: the fixed beacons count as those of a platform without "
                "motion and errors"
            )
    if given.waited:
        lines.append(
            f"{counted(given.waited, 'range')} waited for the next update, as receivers take "
            f"one of a beacon in {ready.interval_ns / 1e9:g} s"
        )
    if len(ready.log.beacons) > ready.slots:
        lines.append(
            f"{len(ready.log.beacons)} beacons share the {ready.slots} places of the receivers, by "
            "latest use"
        )
    return [*lines, *ready.log.without_depth(), *_claims(ready), *doubts_of(ready, choice)]


def _claims(ready: Settled) -> list[str]:
    """What speaks against claimed errors before a receiver has run."""
    if ready.newest:
        return []
    log, lines = ready.log, []
    platform = ready.scenario.platform
    if ready.arrangement == "platform" and not platform.watch_circle_m:
        spread = drift_of(log)
        errors = hypot(
            platform.gps_horizontal_std_m, platform.gps_horizontal_markov_std_m,
            platform.gps_horizontal_bias_std_m, platform.surge_amplitude_m,
            platform.sway_amplitude_m,
        )
        if spread > _SPREAD * max(errors, 1.0):
            lines.append(
                f"platform: 95 % of its reported positions spread over {meters(spread)}, but in "
                "the settings it stays at its place, so receivers take that for errors of its GPS: "
                "set platform.motion = \"spectrum\" and platform.watch_circle_m"
            )
    if ready.alike > _ALIKE:
        lines.append(
            "ranges: errors of a beacon are correlated in time, but receivers expect independent "
            f"ones: their claims may be too small, perhaps by a factor of {rounded(ready.alike, 2)}"
        )
    if log.meta.dimension == 2:
        return lines
    same = len(log.depth) >= _SAME and np.ptp(log.depth) == 0.0
    if log.meta.depth_is == "truth":
        lines.append("depth: made of the truth, so errors are those of a device with such a depth")
    elif log.meta.depth_is == "none" or same:
        why = "not measured" if log.meta.depth_is == "none" else (
            f"all {len(log.depth):,} readings are the same, as if not measured"
        )
        lines.append(
            f"depth: {why}: receivers take it as measured, so if it is wrong, their claims are too "
            "small"
        )
    return lines
