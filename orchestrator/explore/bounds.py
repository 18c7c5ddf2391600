"""What a page needs to compute what is possible: facts of `sblcosim.limits`, as plain data."""

from __future__ import annotations

from typing import Any

from sblcosim.models import RECEIVERS
from sblcosim.models.acoustics.ranging import INVERTED
from sblcosim.models.acoustics.schedules import SCHEDULES, Schedule
from sblcosim.models.ports import BEACONS
from sblcosim.models.receiver.bound import BOUNDS, SITUATION

from ..limits import parameters
from ..limits.recursion import BoundTask
from ..limits.run import MOST_EPOCHS
from ..limits.unknown import MATTERS
from ..limits.verdict import MOST_BEARING_STD, MOST_DISTANCE_SHARE
from ..scenario import arrangement
from ..scenario.error_sources import DELAYS, SURVEY, UNMODELLED
from ..scenario.schema import Platform
from ..wasm.modules import fields_of

_OF_MODELS = {
    name: next(it for it, own in RECEIVERS.items() if own.name == receiver.name)
    for name, receiver in parameters.RECEIVERS.items()
}
"""Names of the receivers whose models bounds use."""
PARAMETERS = frozenset((
    "coupled.beacon_offset",
    *(f"{_OF_MODELS[name]}.{it}" for name, own in BOUNDS.items() for it in own.parameters),
))
"""Parameters of receivers that a bound needs, by their names in `sblcosim.scenario.settings`."""


def facts() -> dict[str, Any]:
    """Models and constants of what is possible; `js/possible.js` reads them."""
    return {
        "task": fields_of(BoundTask),
        "situation": [*SITUATION],
        "models": {name: _model(number, name) for number, name in enumerate(BOUNDS)},
        "inverted": [*INVERTED],
        "schedules": {name: _schedule(it) for name, it in SCHEDULES.items()},
        "most_bearing": MOST_BEARING_STD, "most_distance": MOST_DISTANCE_SHARE,
        "most_epochs": MOST_EPOCHS, "matters": MATTERS,
        "unmodelled": [*UNMODELLED], "survey": SURVEY, "delays": DELAYS,
        **arrangement.keys_of_errors(Platform),
    }


def _schedule(schedule: Schedule) -> dict[str, Any]:
    """By number of beacons: how many ping at once, and the place of the first, slot by slot."""
    return {
        str(n): {
            "together": schedule.together(n),
            "first": [int(schedule.place(slot)) % n for slot in range(n)],
        } for n in range(BEACONS.least, BEACONS.most + 1)
    }


def _model(number: int, name: str) -> dict[str, Any]:
    """Number, receiver and parameters of a model, and the start values of these."""
    receiver, names = _OF_MODELS[name], BOUNDS[name].parameters
    return {
        "number": number, "receiver": receiver, "parameters": [*names],
        "start": {it: RECEIVERS[receiver][it].starts[0] for it in names},
    }
