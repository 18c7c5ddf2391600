"""From the keys of a scenario to the start values of all components, as expressions.

The functions of this folder are run on expressions instead of numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from .. import RECEIVERS, declared
from ..acoustics.schedules import schedule_of
from ..declaration import Component, Variable
from .assumptions import (
    PARAMETERS,
    assumed,
    clock,
    common_noise,
    knowledge,
    lasting_delay,
    levels,
    range_noise,
    with_common,
)
from .boat import RATES, heading
from .either import where
from .expression import Expression, computed, inputs_of, ordered, symbol
from .keys import OF_RECEIVERS, in_si
from .names import TableOfInputs, branching, chosen, elements, names_of
from .times import update_interval

TABLES = ("target", "platform", "acoustics")
_Values = Mapping[str, tuple[Expression, ...]]


@dataclass(frozen=True)
class StartValues:
    """Start values of the components for a number of beacons.

    Attributes
    ----------
    inputs
        Elements of the keys that `computed` depends on, ``"platform.gps_antenna_offset_m[2]"``, in
        the units of a scenario file. Choices, switches and named values are numbers. Of a boat's
        track there are only its `sblcosim.models.settings.boat.RATES`.
    computed
        Elements of parameters by name, ``"coupled.gps_std"``, in SI units.
    copied
        Parameters whose value is that of a key, and these keys: ``{"target.speed":
        "target.speed_m_s"}``.
    optional
        Keys that need not be given: NaN then stands for each of their elements. All others have a
        value, by default their start value.
    levels
        What a bound needs besides parameters of receivers; see `_levels`.
    """

    inputs: tuple[str, ...]
    computed: _Values
    copied: Mapping[str, str]
    optional: frozenset[str]
    levels: Mapping[str, Expression]

    @property
    def keys(self) -> Mapping[str, Sequence[str]]:
        """Parameters that are computed, and the keys that determine each of them."""
        return {name: _keys(inputs_of(*values)) for name, values in self.computed.items()}

    @property
    def unknown(self) -> Mapping[str, Sequence[str]]:
        """Parameters that may be NaN, and the keys that decide whether they are."""
        return {
            name: _keys(inputs_of(*(
                it.operands[0] for it in ordered(values)
                if it.operation == "where" and it.perhaps_unknown
            )))
            for name, values in self.computed.items() if any(it.perhaps_unknown for it in values)
        }  # fmt: skip


def _keys(inputs: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(it.partition("[")[0] for it in inputs))


@cache
def start_values(beacons: int) -> StartValues:
    """The start values of all components of systems with this number of beacons."""
    known = {name: declared(name, beacons=beacons) for name in (*TABLES, *RECEIVERS)}
    filled = _filled(known["platform"])
    told = _told(known, filled, beacons)
    found: dict[str, tuple[Expression, ...]] = {}
    copied: dict[str, str] = {}
    optional = {*filled}
    order = {name: place for place, name in enumerate(_TIMES)}
    for name, component in known.items():
        kind = _kind(component)
        for variable in component.of("parameter"):
            path = f"{name if name in TABLES else 'receiver'}.{variable.key}"
            for each in elements(path, variable):
                order.setdefault(each, len(order))
            values = filled.get(path) or tuple(map(symbol, elements(path, variable)))
            # A name is its number here, for which there is nothing to convert.
            if not names_of(variable) and not variable.named:
                values = _in_si(variable, values)
            if name in RECEIVERS and variable.key in told[kind]:
                values = _or(path, variable, values, told[kind][variable.key])
                optional.add(path)
            if all(it.operation == "input" for it in values):
                copied[f"{name}.{variable.name}"] = path
            else:
                found[f"{name}.{variable.name}"] = values
    for each in RATES:
        order[each] = len(order)
    needed = _levels(_tables(known, filled, beacons)[-1], beacons)
    inputs = inputs_of(*(it for values in found.values() for it in values), *needed.values())
    return StartValues(
        tuple(sorted(inputs, key=order.__getitem__)), found, copied, frozenset(optional), needed
    )


def _or(
    path: str, variable: Variable, own: Sequence[Any], otherwise: Sequence[Any]
) -> tuple[Any, ...]:
    """Values for where a key is given, and for where it is not: NaN does not equal itself."""
    given = (computed("eq", key, key) for key in map(symbol, elements(path, variable)))
    return tuple(where(*each) for each in zip(given, own, otherwise, strict=True))


def _in_si(variable: Variable, values: Sequence[Any]) -> tuple[Any, ...]:
    """The elements of a parameter in SI units."""
    return tuple(in_si(variable, values)) if variable.shape else (in_si(variable, values[0]),)


# --- What is filled in ---------------------------------------------------------------------------

_TIMES = ("time.sampling_time_s", "time.ekf_ratio")


def _filled(platform: Component) -> _Values:
    """Values of those keys of components that follow from others unless they are given."""
    table = TableOfInputs("platform", platform.of("parameter"), {}, {}, 0)
    own = {f"{name}.sampling_time_s": symbol(_TIMES[0]) for name in TABLES}
    own["platform.mean_heading_deg"] = heading(table)
    found = {}
    for path, otherwise in own.items():
        variable = next(v for v in platform.of("parameter") if v.key == path.split(".")[1])
        found[path] = _or(path, variable, [symbol(path)], [otherwise])
    return found


# --- What receivers are told ---------------------------------------------------------------------

_Kind = tuple[tuple[str, bool], ...]
"""What decides what a receiver is told: what it knows, and whether it has any assumption."""


def _kind(component: Component) -> _Kind:
    names = {v.name for v in component.of("parameter")}
    return *knowledge(names).items(), ("everything", not PARAMETERS.isdisjoint(names))


def _told(
    known: Mapping[str, Component], filled: _Values, beacons: int
) -> Mapping[_Kind, _Values]:
    """What each kind of receiver is told, by keys of ``[receiver]``, in SI units."""
    tables = _tables(known, filled, beacons)
    kinds = {_kind(known[name]) for name in RECEIVERS}
    sources = OF_RECEIVERS["pose_source"]
    given = symbol("receiver.pose_source")
    found = _told_with(None, kinds, *tables)
    for name, value in names_of(sources).items():
        found = chosen(given == value, _told_with(name, kinds, *tables), found)
    return found


def _tables(
    known: Mapping[str, Component], filled: _Values, beacons: int
) -> list[TableOfInputs]:
    values = {path: it[0] for path, it in filled.items()}
    return [
        TableOfInputs(name, known[name].of("parameter"), {}, values, beacons) for name in TABLES
    ]


@branching
def _told_with(
    source: str | None, kinds: set[_Kind], target: Any, platform: Any, acoustics: Any
) -> dict[_Kind, dict[str, tuple[Any, ...]]]:
    """The same for a receiver with this ``pose_source``, or without a given one."""
    tables = target, platform, acoustics
    systems = {True: assumed(*tables, source), False: clock(acoustics)}
    found: dict[_Kind, dict[str, tuple[Any, ...]]] = {}
    for kind in kinds:
        known = dict(kind)
        values = levels(systems[known.pop("everything")], *tables, **known)
        values["update_interval_s"] = update_interval(*map(symbol, _TIMES))
        found[kind] = {
            key: _in_si(OF_RECEIVERS[key], value if OF_RECEIVERS[key].shape else (value,))
            for key, value in values.items()
        }
    return found


# --- What a bound needs --------------------------------------------------------------------------


@branching
def _levels(acoustics: Any, beacons: int) -> dict[str, Any]:
    """White noise of ranges, what a ping shares, what lasts for each beacon [m]; slots of a round.

    ``range_noise`` is without what a ping shares, ``noise`` with it.
    """
    noise = range_noise(acoustics)
    return {
        "range_noise": noise,
        "noise": with_common(noise, acoustics),
        "common_noise": common_noise(acoustics),
        "lasting_delay": lasting_delay(acoustics),
        "slots": beacons / schedule_of(acoustics).together(beacons),
    }
