"""The most probable track of a whole log, with the smoother of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import INITIALISATION

from ..data.estimates import Estimates, Floats
from ..data.record import Record
from ..data.samples import OWN, Samples
from ..errors import ConfigurationError
from ..estimation import belief, field, model, outcome, smoother, start
from ..scenario.sources import choice_of
from ..scenario.wiring import applied
from ..simulation.how import How
from ..words.lists import listed
from .playing import plane_of
from .quality import resemblance
from .running import Ran, placed, ran, start_of_truth
from .settings import Settled

SMOOTHER = "smoother"
"""Label of the smoother in tables and figures."""
_WIDER = 1.25
"""Smaller factors are chance."""
_FIRST_RECEPTIONS = number_of(INITIALISATION, "first_receptions")
"""Without a prior: a track has ranges enough of its own."""


def smoothed(ready: Settled, made: Ran) -> tuple[Estimates, Sequence[str], list[str]]:
    """The smoother's estimates of a log, what speaks against them, and remarks.

    It uses the model of `coupled` for beacons on a platform, otherwise that of `long_baseline`,
    whose errors of the beacons' places take constant offsets of ranges up as well. It begins with
    the estimates of that receiver, which is run if need be. If its track is not believable, the
    estimates are those of the receiver.

    Raises
    ------
    ConfigurationError
        There are more beacons than a receiver has places for.
    """
    if len(ready.log.beacons) > ready.slots:
        raise ConfigurationError(
            f"smooth: must be left out with more than {ready.slots} beacons, got "
            f"{len(ready.log.beacons)}"
        )
    name = "coupled" if ready.arrangement == "platform" else "long_baseline"
    record = made.record
    label = start.ran(record, name)
    if label is None:
        chosen = choice_of(ready.scenario, name)
        record, label = ran(ready, chosen, How(None, None)).record, name
    scenario = applied(ready.scenario, choice_of(ready.scenario, name))
    in_field = name == "long_baseline"
    of = field.IN_FIELD if in_field else model.ON_PLATFORM
    samples = _samples(ready, made, in_field)
    p = model.parameters(scenario, start_of_truth(ready), of.component)
    if in_field:
        p = field.with_unknowns(p, 0.0, 0.0)
    if ready.window is not None:
        p = SimpleNamespace(**vars(p) | {"initialisation": _FIRST_RECEPTIONS})
    learned = model.settled(p, label, record)
    track = smoother.smooth(
        learned, samples, _trajectory(record, label, p, samples, in_field),
        learns=learned is not p, of=of,
    )
    filtered = record.estimates(label)
    doubts = belief.doubts(p, samples, track, filtered)
    makes = field.of_states if in_field else outcome.of_states
    remarks = []
    wider = 1.0 if ready.newest else resemblance(samples.beacon, track.residual)
    if wider < _WIDER:
        wider = 1.0
    elif not doubts:
        remarks.append(
            f"{SMOOTHER}: residuals of a beacon are correlated in time, so its claims are "
            f"{wider:.1f} times as wide as if they were independent"
        )
    own = makes(p, samples, track.mean, track.covariance * wider**2)
    if doubts:
        own = replace(filtered, available_ns=None, until_ns=None, update_count=None)
        remarks.append(
            f"{SMOOTHER}: its track is not believable, as {listed(doubts)}; its estimates are "
            f"those of {label!r}"
        )
    return placed(own, made.played.start_ns, ready.origin), doubts, remarks


def _samples(ready: Settled, made: Ran, in_field: bool) -> Samples:
    """The samples in the times and coordinates of the ticks."""
    samples = ready.log.samples(OWN if in_field else None)
    late = ready.log.start_ns - made.played.start_ns
    depth_ns, depth = samples.depth_ns, samples.depth
    if ready.log.meta.dimension == 2:
        depth_ns = np.unique(samples.range_ns)
        depth = np.full(len(depth_ns), plane_of(ready.log))
    return replace(
        samples, start_ns=0, depth_ns=depth_ns + late, depth=depth,
        range_ns=samples.range_ns + late, position=samples.position - ready.origin,
    )


def _trajectory(
    record: Record, label: str, p: Any, samples: Samples, in_field: bool
) -> Floats:
    of = field.trajectory if in_field else start.trajectory
    return of(record, label, p, samples)
