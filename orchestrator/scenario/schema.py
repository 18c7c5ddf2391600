"""The tables of a scenario file, generated from the declarations of the components.

A key is the name of a parameter with its unit as suffix. Angles are in degrees, choices are given
by name, arrays row by row. Bounds and descriptions come from the declaration.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from copy import copy
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    WithJsonSchema,
    create_model,
)
from pydantic_core import PydanticCustomError
from sblcosim.fmus.host.nanoseconds import MAX_SECONDS, nanoseconds, settled
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.models.acoustics.variables import PROFILE
from sblcosim.models.declaration import Bounds, Variable
from sblcosim.models.ports import BEACONS
from sblcosim.models.settings.keys import OF_RECEIVERS, in_file_units, is_list
from sblcosim.models.settings.presets import DECLARED

from ..shown import public
from .arrays import counts_of, flat, json_schema, most

CORE_COMPONENTS = ("target", "platform", "acoustics")
"""The components that every system has; their tables have the same names."""
PATH: Final = "path"
"""Value of ``duration_s``: run until the end of the target's path."""
TRUE: Final = "true"
"""Value of ``prior``: start at the true position, at rest."""
SHARED_PARAMETERS = ("sampling_time", "update_interval", "seed", "range_std", "depth_std")
"""Parameters that a third-party component always gets, if it has them."""
FILES = ("fmu", "track_file")
"""Keys that are paths of files, relative to the scenario's own."""
PRIOR_KEYS = ("prior_position_m", "prior_velocity_m_s")
_T = TypeVar("_T", bound="Table")
_TICKS = frozenset(c.interval for c in COMPONENTS.values())


def _name(value: str) -> str:
    if not re.fullmatch(r"\w[^/\\\x00-\x1f\x7f]*", value):
        raise PydanticCustomError(
            "name", "must begin with a letter or digit and have no slash or control character"
        )
    if len(value.encode("utf-8", "replace")) > LONGEST_NAME:
        raise PydanticCustomError(
            "name", "must have at most {most} bytes in UTF-8", {"most": LONGEST_NAME}
        )
    return value


LONGEST_NAME = 200
"""Longest name of a scenario or study [bytes]: with a suffix, it must fit into a folder name."""
Name = Annotated[
    str,
    AfterValidator(_name),
    WithJsonSchema(
        {
            "type": "string",
            "maxLength": LONGEST_NAME,
            "pattern": r"^[^\x00-/:-@\[-^`{-\x7f][^/\\\x00-\x1f\x7f]*$",
        }
    ),
]


class Table(BaseModel):
    """One table of a scenario file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    variables: ClassVar[Mapping[str, Variable]] = {}

    if TYPE_CHECKING:

        def __getattr__(self, key: str) -> Any: ...

    def __dir__(self) -> list[str]:
        # Without pydantic's names: keys and methods of a table remain.
        return [name for name in public(super().__dir__()) if not hasattr(BaseModel, name)]


def given_of(table: Table) -> dict[str, Any]:
    """The keys of a table that were given, and their values."""
    own = table.__dict__
    return {key: own[key] for key in table.model_fields_set}


def filled(table: _T, values: Mapping[str, Any]) -> _T:
    """A copy of a table with values for missing keys, which do not count as given."""
    full = copy(table)
    full.__dict__.update(values)
    full.__dict__.update(given_of(table))
    return full


def valid(kind: type[Table], content: Any) -> Any:
    """A table from its content. Invalid values stay, to be refused with the rest."""
    try:
        return kind.model_validate(content)
    except ValidationError:
        return content


@cache
def empty(kind: type[_T]) -> _T:
    """A table without given keys."""
    return kind()


def table_field(kind: type[_T]) -> Any:
    """The field for an optional table."""
    return Field(default_factory=partial(empty, kind))


def range_of(variable: Variable) -> Bounds:
    """Bounds of the numbers of a key, in its unit."""
    low, high = (
        None if bound is None else in_file_units(variable, bound)
        for bound in map(most, variable.bounds)
    )
    return low, high


def _annotation(variables: Iterable[Variable], variable: Variable) -> Any:
    """Type of a key, with the bounds from the declaration."""
    low, high = range_of(variable)
    annotation: Any
    if variable.choices is not None:
        annotation = Literal[tuple(variable.choices.values())]
    elif variable.type == "Boolean":
        annotation = bool
    elif variable.type == "Int32":
        annotation = Annotated[int, Field(ge=low, le=high)]
    elif variable.named:
        annotation = _or_name(tuple(variable.named), low, high)
    else:
        annotation = Annotated[float, Field(ge=low, le=high, allow_inf_nan=False)]
        if variable.name in _TICKS:
            annotation = Annotated[annotation, AfterValidator(settled)]
    if variable.shape:
        counts = counts_of(variable, is_list(variables, variable))
        check = partial(flat, variable.shape, counts)
        annotation = Annotated[
            tuple[annotation, ...],
            BeforeValidator(check),
            WithJsonSchema(json_schema(variable, counts, low, high)),
        ]
    return annotation


def _or_name(names: tuple[str, ...], low: float | None, high: float | None) -> Any:
    """Type of a number within bounds that may be given by a name instead."""
    bounds = {"minimum": low, "maximum": high}
    number = {"type": "number"} | {k: v for k, v in bounds.items() if v is not None}
    return Annotated[
        float | Literal[names],
        BeforeValidator(partial(_number_or_name, names, low, high)),
        WithJsonSchema({"anyOf": [number, {"enum": [*names]}]}),
    ]


def _number_or_name(
    names: tuple[str, ...], low: float | None, high: float | None, value: Any
) -> Any:
    if isinstance(value, str) and value in names:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        must = "a number"
    elif not math.isfinite(value):
        must = "a finite number"
    elif low is not None and value < low:
        must = f"at least {low:g}"
    elif high is not None and value > high:
        must = f"at most {high:g}"
    else:
        return float(value)
    words = " or ".join(map(repr, names))
    raise PydanticCustomError(
        NAMED, "must be {must} or {words}", {"must": must, "words": words, "names": [*names]}
    )


NAMED = "named"
"""Kind of the error in a number that may be given by a name; its context has the ``names``."""


def table_class(name: str, variables: Iterable[Variable], extra: Mapping[str, Any]) -> type[Table]:
    """Make the class of a table: extra keys first, then one per parameter."""
    parameters = {v.key: v for v in variables if v.causality == "parameter"}
    keys: dict[str, Any] = dict(extra)
    for key, variable in parameters.items():
        annotation = _annotation(parameters.values(), variable)
        keys[key] = (annotation | None, Field(None, description=variable.description))
    table: type[Table] = create_model(name, __base__=Table, __module__=__name__, **keys)
    table.variables = parameters
    return table


def _presets(table: str) -> dict[str, Any]:
    """The keys of a table that set other keys."""
    keys: dict[str, Any] = {}
    for name, preset in DECLARED.items():
        if preset.table != table:
            continue
        values = tuple(preset.values)
        annotation: Any = Literal[values]
        if isinstance(values[0], int):
            annotation = Annotated[int, Field(ge=min(values), le=max(values))]
        keys[name] = annotation | None, Field(None, description=preset.description)
    return keys


_Seconds = Annotated[float, Field(gt=0.0, allow_inf_nan=False), AfterValidator(settled)]
COMMON: Mapping[str, Any] = {
    "fmu": (
        str | None,
        Field(
            None,
            description="File of another FMU; for a receiver also FILE.py:CLASS; relative to "
            "the scenario's file",
        ),
    ),
    "fmi": (Literal[2, 3] | None, Field(None, description="FMI version of this component")),
    "interval_s": (_Seconds | None, Field(None, description="Communication interval")),
    "parameters": (
        dict[str, Any] | None,
        Field(None, description="Further parameters of the other file, with its names and units"),
    ),
}


def _track(use: str) -> dict[str, Any]:
    """The keys of a table from which the points of a recorded track follow."""
    return {
        "track_file": (
            str | None,
            Field(
                None,
                description=f"File of a recorded track, .csv or .gpx, {use}; relative to the "
                "scenario's file",
            ),
        ),
        "track_tolerance_m": (
            Annotated[float, Field(gt=0.0, le=1e5, allow_inf_nan=False)] | None,
            Field(None, description="Largest allowed distance from the recorded track"),
        ),
    }


def _number(low: float, high: float, description: str) -> tuple[Any, Any]:
    """A key that holds a number within bounds."""
    bounds = Field(ge=low, le=high, allow_inf_nan=False)
    return Annotated[float, bounds] | None, Field(None, description=description)


def _numbers(low: float, high: float, description: str) -> tuple[Any, Any]:
    """A key that holds a number within bounds for each point of a profile."""
    element = Annotated[float, Field(ge=low, le=high, allow_inf_nan=False)]
    several = Annotated[
        tuple[element, ...], Field(max_length=PROFILE), BeforeValidator(_as_tuple)
    ]
    return several | None, Field(None, description=description)


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_CHANNEL: Mapping[str, Any] = {
    "temperature_C": _number(-2.0, 42.0, "Temperature of the water, which sets a missing "
                             "sound_speed_m_s by TEOS-10"),
    "salinity": _number(0.0, 42.0, "Practical salinity of the water; 35 if not given"),
    "sample_depth_m": _number(0.0, 12000.0, "Depth at which temperature and salinity hold"),
    "profile_temperature_C": _numbers(-2.0, 42.0, "Temperatures at the depths of the profile, "
                                      "which set missing speeds by TEOS-10"),
    "profile_salinity": _numbers(0.0, 42.0, "Practical salinities at the depths of the profile; "
                                 "missing: salinity"),
    "packet_duration_s": _number(1e-6, 1e3, "Duration of a packet; with guard_interval_s and "
                                 "reach_m it sets a missing sampling_time_s of [time]"),
    "guard_interval_s": _number(0.0, 1e3, "Silence after a packet and its echoes"),
    "reach_m": _number(0.0, 1e5, "Distance within which packets must not collide"),
}
"""Keys of ``[acoustics]`` from which the speed of sound and the slot follow."""

if TYPE_CHECKING:
    # A type checker cannot know the keys: they are generated from the declarations.
    class Target(Table):
        """Table ``[target]``."""

    class Platform(Table):
        """Table ``[platform]``."""

    class Acoustics(Table):
        """Table ``[acoustics]``."""

    class Receiver(Table):
        """Table ``[receiver]``: keys of all our receivers."""

else:
    Target = table_class(
        "Target",
        COMPONENTS["target"],
        {
            **COMMON,
            **_presets("target"),
            **_track("for trajectory 'file'"),
        },
    )
    Platform = table_class(
        "Platform",
        COMPONENTS["platform"],
        {
            **COMMON,
            **_presets("platform"),
            **_track("which the boat follows"),
            "beacons": (
                Annotated[int, Field(ge=BEACONS.least, le=BEACONS.most)] | None,
                Field(None, description="Number of beacons; that of beacon_m if given"),
            ),
        },
    )
    Acoustics = table_class(
        "Acoustics",
        COMPONENTS["acoustics"],
        {
            **COMMON,
            **_presets("acoustics"),
            "packet_bits": (
                Annotated[int, Field(ge=0, le=1_000_000)] | None,
                Field(None, description="Bits of a packet: sets missing resolutions; 0: not "
                      "limited"),
            ),
            **_CHANNEL,
        },
    )
    Receiver = table_class(
        "Receiver",
        OF_RECEIVERS.values(),
        {
            "type": (
                Literal[tuple(RECEIVERS)] | None,
                Field(None, description=f"One of our receivers: {', '.join(RECEIVERS)}"),
            ),
            **COMMON,
            "prior": (
                Annotated[
                    Literal[TRUE] | None, BeforeValidator(lambda v: TRUE if v is True else v)
                ],
                Field(None, description="'true': the prior is the true start, at rest"),
            ),
        },
    )


def _duration(value: Any) -> Any:
    if value == PATH:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        problem = "must be a number or 'path'"
    elif not 0.0 < value < math.inf:
        problem = "must be more than 0"
    elif value >= MAX_SECONDS:
        problem = f"must be less than {MAX_SECONDS:g}"
    else:
        return settled(float(value))
    raise PydanticCustomError("duration", problem)


_TICK = COMPONENTS["acoustics"]["sampling_time"]
SEED = COMPONENTS["acoustics"]["seed"]


class Time(Table):
    """Table ``[time]``."""

    sampling_time_s: Annotated[
        float, Field(ge=_TICK.min, le=_TICK.max, allow_inf_nan=False), AfterValidator(settled)
    ] = Field(
        default=float(_TICK.starts[0]),
        description="The paper's T: time between samples of all sensors and between pings (one "
        "beacon pings after the other, so each of four pings every 4 T; "
        "acoustics.schedule = \"simultaneous\" lets all ping at once)",
    )
    ekf_ratio: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=1, description="Number of sampling times per update of the receiver"
    )
    duration_s: Annotated[
        float | Literal["path"],
        BeforeValidator(_duration),
        WithJsonSchema(
            {
                "anyOf": [
                    {"enum": [PATH]},
                    {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": MAX_SECONDS},
                ]
            }
        ),
    ] = Field(
        default=PATH, description="Length of the run; 'path': until the end of the target's path"
    )


class Place(Table):
    """Table ``[place]``."""

    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0, allow_inf_nan=False)] | None = Field(
        default=None, description="Latitude of the origin of north, east and down, on WGS 84"
    )
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0, allow_inf_nan=False)] | None = Field(
        default=None, description="Longitude of the origin"
    )
    height_m: Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)] = Field(
        default=0.0, description="Height of the water surface above the ellipsoid"
    )


TABLES: Mapping[str, type[Table]] = {
    "time": Time, "place": Place, "target": Target, "platform": Platform, "acoustics": Acoustics,
    "receiver": Receiver,
}
"""The tables of a scenario."""


def divides(part: float, whole: float) -> bool:
    """Whether one time is a whole multiple of another."""
    return nanoseconds(part) > 0 and nanoseconds(whole) % nanoseconds(part) == 0


def rows(variable: Variable | None, value: Any) -> Any:
    """Nest the elements of a two-dimensional array by rows."""
    if variable is None or len(variable.shape) != 2:
        return value
    width = variable.shape[1]
    return [value[i : i + width] for i in range(0, len(value), width)]


def toml(value: Any) -> str:
    """Write a value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    return str(value)
