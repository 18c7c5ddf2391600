"""What a log says about itself: ``meta.toml``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from ..errors import ConfigurationError, nearest, quoted, shortened
from ..scenario.messages import requirement
from ..tracks.place import Origin
from ..words.lists import first_of
from .columns import FARTHEST

FILE = "meta.toml"
UNUSED = "keys without a meaning in a log are not used"
_Finite = Annotated[float, Field(allow_inf_nan=False, ge=-FARTHEST, le=FARTHEST)]
Place = tuple[_Finite, _Finite, _Finite]
"""North, east, down [m]."""


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


_Triple = Annotated[Place, BeforeValidator(_as_tuple)]


class _Table(BaseModel):
    """A table of ``meta.toml``."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class OriginTable(_Table):
    """Origin of north, east and down, on WGS 84."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]
    height_m: _Finite = 0.0


class TruthClock(_Table):
    """Clock of the truth: what must be added to its times [s]."""

    offset_s: _Finite | Literal["estimate"] = 0.0


class Clock(_Table):
    """Clocks of the log."""

    truth: TruthClock = TruthClock()
    epoch: str = ""


BEACONS = "beacons"
"""Name in `Frame.own_axes` for the beacons, and so for the receivers that use them."""


class Frame(_Table):
    """Axes of the truth, and which positions are not north, east, down.

    Attributes
    ----------
    truth
        Whether its origin and heading are those of the beacons (``"same"``), or its own: then the
        turn and the shift are estimated.
    own_axes
        Devices whose positions are along axes of their own, such as forward and starboard of a
        boat with an unknown direction; ``"beacons"`` for the beacons.
    """

    truth: Literal["same", "estimate"] = "same"
    own_axes: Annotated[tuple[str, ...], BeforeValidator(_as_tuple)] = ()


class Meta(_Table):
    """Everything about a log that is not in its tables.

    Attributes
    ----------
    name, title
        Name and title of the log.
    dimension
        3, or 2: positions in the plane of the beacons, without depth.
    sound_speed_m_s
        Speed of sound with which ranges were formed, or turned from times of flight.
    depth_is
        Where the depth is from: a sensor, the truth, or nowhere.
    beacons
        Positions of fixed beacons: north, east, down [m]. Beacons that report their position in
        packets need no place here.
    arms_m
        Nominal positions of the beacons on a platform, body frame [m].
    interval_s
        Time between two emissions of a beacon [s], if known.
    start_ns, stop_ns
        Begin and end of the log [ns]; without them, the first and the last time in it count.
    origin, clock, frame
        See their classes.
    source, licence, notes
        Where the log is from, for people.
    """

    name: str = ""
    title: str = ""
    dimension: Literal[2, 3] = 3
    sound_speed_m_s: Annotated[float, Field(ge=1, le=10_000)] = 1500.0
    depth_is: Literal["sensor", "truth", "none"] = "sensor"
    interval_s: Annotated[float, Field(gt=0)] | None = None
    start_ns: int | None = None
    stop_ns: int | None = None
    beacons: dict[str, _Triple] = {}
    arms_m: dict[str, _Triple] = {}
    origin: OriginTable | None = None
    clock: Clock = Clock()
    frame: Frame = Frame()
    source: dict[str, Any] | str = ""
    licence: str = ""
    notes: str = ""

    @property
    def place(self) -> Origin | None:
        """The origin on Earth, if known."""
        given = self.origin
        if given is None:
            return None
        return Origin(given.latitude_deg, given.longitude_deg, given.height_m)


def meta_of(tables: Mapping[str, Any], where: str) -> tuple[Meta, list[str]]:
    """Check what a log says about itself.

    Parameters
    ----------
    where
        Name of the file, for messages.

    Returns
    -------
    meta, remarks
        What is known, and sentences about the keys that have no meaning here.

    Raises
    ------
    ConfigurationError
        A value is wrong.
    """
    given = {key: dict(value) if isinstance(value, Mapping) else value
             for key, value in tables.items()}
    clock, remarks = given.get("clock"), []
    if isinstance(clock, dict) and isinstance(clock.get("truth"), str):
        words, clock["truth"] = clock["truth"], {"offset_s": "estimate"}
        if words != "estimate":
            remarks.append(f"{where}: clock.truth = {quoted(words)}: its offset is estimated")
    unknown = [*_unknown(given, Meta)]
    if unknown:
        names = first_of(unknown, 5)
        remarks.append(f"{where}: {UNUSED}: {names}")
    try:
        return Meta.model_validate(given), remarks
    except ValidationError as error:
        first, *others = error.errors()
        more = f" (and {len(others)} more)" if others else ""
        raise ConfigurationError(f"{_line(first, where)}{more}") from None


def _unknown(tables: dict[str, Any], of: type[BaseModel], above: str = "") -> Iterator[str]:
    """Take the keys out that a table does not have; their names."""
    for key in [*tables]:
        field = of.model_fields.get(key)
        if field is None:
            del tables[key]
            close = nearest(key, of.model_fields).removeprefix("; ")
            yield shortened(f"{above}{key}") + (f" ({close})" if close else "")
            continue
        kinds = (field.annotation, *get_args(field.annotation))
        inner = next((k for k in kinds if isinstance(k, type) and issubclass(k, _Table)), None)
        if inner is not None and isinstance(tables[key], dict):
            yield from _unknown(tables[key], inner, f"{above}{key}.")


def _line(error: Any, where: str) -> str:
    path = [str(part) for part in error["loc"] if part not in ("float", "literal['estimate']")]
    name = shortened(".".join(path))
    if error["type"] == "missing":
        return f"{where}: {name}: must be given, got nothing"
    must, choices = requirement(error)
    got = error["input"]
    close = nearest(got, choices) if isinstance(got, str) else ""
    return f"{where}: {name}: {must}, got {shortened(repr(got))}{close}"
