"""Scenario files: a complete run in one TOML text, with units in its keys.

Loading fills in whatever a file leaves out, so a `Scenario` holds every number of its run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator
from sblcosim.fmus.host.nanoseconds import SECOND, is_whole_ns, nanoseconds, settled
from sblcosim.models.settings.assumptions import PARAMETERS, knowledge, levels
from sblcosim.models.settings.presets import PRESET_TABLES
from sblcosim.models.settings.times import update_interval

from ..errors import ConfigurationError, instance, resolved
from ..simulation.plans.alike import alike
from ..simulation.system import PythonComponent
from ..tracks.resample import TooFewError
from . import arrangement, channel, effects, files, filling, library, packets, timing, tracks, water
from .assumptions import assumed
from .messages import cross_check, is_table, lines
from .overrides import Changes, override, without_none
from .reading import check_values, parse, read_text, relative, shown
from .schema import (
    CORE_COMPONENTS,
    FILES,
    PRIOR_KEYS,
    SEED,
    SHARED_PARAMETERS,
    TRUE,
    Acoustics,
    Name,
    Place,
    Platform,
    Receiver,
    Table,
    Target,
    Time,
    divides,
    filled,
    given_of,
    rows,
    table_field,
    toml,
)

_PERIODS = ("sampling_time_s", "update_interval_s", "interval_s")
_SHIPPED = resources.files("sblcosim.scenario") / "shipped"

Source = str | Path | Callable[[], PythonComponent]
"""A receiver's name, an FMU file, ``file.py:Class``, or a callable that makes a component."""
Receivers = Source | Sequence[Source] | Mapping[str, Source]
"""One or more receivers; a mapping gives them labels."""


class Scenario(Table):
    """The complete description of a run.

    Made by `load`, which fills in everything that a file leaves out.

    Attributes
    ----------
    name, title
        For display, and for the name of the result folder.
    seed
        Seed of all random numbers; a component may have its own.
    fmi
        FMI version (2 or 3) of the components.
    time, place, target, platform, acoustics, receiver
        The tables, with the keys of a scenario file: ``scenario.platform.arm_length_m``.
    """

    name: Name = Field(default="scenario", description="Short name, also of the results folder")
    title: str = Field(default="", description="Title shown above tables and figures")
    seed: Annotated[int, Field(ge=SEED.min, le=SEED.max)] = Field(
        default=int(SEED.starts[0]), description="Seed of all random numbers"
    )
    fmi: Literal[2, 3] = Field(default=2, description="FMI version of the components")
    time: Time = table_field(Time)
    place: Place = table_field(Place)
    target: Target = table_field(Target)
    platform: Platform = table_field(Platform)
    acoustics: Acoustics = table_field(Acoustics)
    receiver: Receiver = table_field(Receiver)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Fill in values that were not given, then check keys against each other."""
        own = self.__dict__
        own["_given"] = {key: own[key] for key in self.model_fields_set}
        if self.acoustics.packet_duration_s is not None:
            own["time"] = self._slotted()
        seconds = self.time.sampling_time_s
        common = {
            "sampling_time_s": seconds, "seed": self.seed,
            "interval_s": self.acoustics.sampling_time_s or seconds,
        }
        beacons = filling.beacons_of(self.platform)
        for name in CORE_COMPONENTS:
            own[name] = filling.component(name, own[name], beacons, common)
        told = self.assumptions(filling.parameters_of(self.receiver))
        update = update_interval(nanoseconds(seconds) / SECOND, self.time.ekf_ratio)
        own["receiver"] = filling.receiver(self.receiver, beacons, told, update)
        problems = [*self._problems()]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def _slotted(self) -> Time:
        """The intervals, with the slot that packets need unless it is given."""
        ends = filled(self.acoustics, water.derived(self.acoustics))
        slot = timing.slot_of(ends)
        if slot is None or "sampling_time_s" in self.time.model_fields_set:
            return self.time
        return filled(self.time, {"sampling_time_s": settled(max(slot.needed_s, 1e-3))})

    def _problems(self) -> Iterator[str]:
        """Contradictions between keys; one line each."""
        receiver = self.receiver
        for name, table in (("time", self.time), *self._tables()):
            given = table.model_fields_set
            for key in () if given.isdisjoint(_PERIODS) else _PERIODS:
                if key in given and not is_whole_ns(getattr(table, key)):
                    yield (
                        f"[{name}] {key}: must be a whole number of nanoseconds, "
                        f"got {getattr(table, key)!r}"
                    )
        for name, table in self._tables():
            if table.fmu is None and table.parameters and name != "receiver":
                yield f"[{name}] parameters: must come with fmu, the FMU that has them"
            tick = "update_interval_s" if name == "receiver" else "sampling_time_s"
            whole = getattr(receiver if name == "receiver" else self.acoustics, tick)
            if "interval_s" in table.model_fields_set and not divides(table.interval_s, whole):
                where = "" if name in ("receiver", "acoustics") else " of [acoustics]"
                yield (
                    f"[{name}] interval_s: must divide {tick}{where} ({whole!r}), "
                    f"got {table.interval_s!r}"
                )
        if not divides(self.acoustics.sampling_time_s, receiver.update_interval_s):
            yield (
                "[receiver] update_interval_s: must be a whole multiple of the sampling time "
                f"({self.acoustics.sampling_time_s!r}), got {receiver.update_interval_s!r}"
            )
        if receiver.type is not None and receiver.fmu is not None:
            both = f"{receiver.type}, {shown(Path(receiver.fmu))}"
            yield f"[receiver]: must have type or fmu, got both ({both})"
        if self.true_prior:
            for key in PRIOR_KEYS:
                if key in receiver.model_fields_set:
                    yield f"[receiver] {key}: must be left out when prior is 'true'"
            if receiver.initialisation not in ("prior", None):
                yield (
                    "[receiver] initialisation: must be 'prior' or be left out when prior is "
                    f"'true', got {receiver.initialisation!r}"
                )
        yield from arrangement.problems(self.platform, self.acoustics, receiver, self.beacons)
        yield from packets.problems(self.platform, self.acoustics, receiver, self.beacons)
        yield from channel.problems(self.target, self.platform, self.acoustics)
        target = self.target
        count = len(target.waypoint_m) // 3
        if target.trajectory == "waypoints" and not 2 <= target.waypoint_count <= count:
            given = "waypoint_count" in target.model_fields_set
            as_many = f", and as many as waypoint_count ({target.waypoint_count})" if given else ""
            yield f"[target] waypoint_m: must have at least 2 rows{as_many}, got {count}"
        for name in tracks.FOLLOWERS:
            if wrong := tracks.problem(name, getattr(self, name)):
                yield wrong
        if (self.place.latitude_deg is None) != (self.place.longitude_deg is None):
            key = "latitude_deg" if self.place.latitude_deg is None else "longitude_deg"
            yield f"[place] {key}: must be given with the other of the two, got none"

    def _tables(self, *names: str) -> Iterator[tuple[str, Any]]:
        for name in names or ("target", "platform", "acoustics", "receiver"):
            yield name, getattr(self, name)

    def __repr__(self) -> str:
        return f"<Scenario {self.name}{self.title and f': {self.title}'}>"

    __str__ = __repr__

    def assumptions(self, parameters: Collection[str] = ("clock_std", "beacon_offset")
    ) -> Mapping[str, Any]:
        """Keys of ``[receiver]`` that are not given: what a receiver may assume about the system.

        Parameters
        ----------
        parameters
            The receiver's parameters. For a receiver that does not estimate its clock, the clock's
            error counts as range noise. For one that is given the arrangement, misplaced beacons
            count as range noise. So does what the arrivals of a ping share, for one that does not
            know it. A receiver without parameters that follow from the system is given only its
            noise levels.
        """
        receiver, tables = self.receiver, (self.target, self.platform, self.acoustics)
        source = receiver.pose_source if "pose_source" in receiver.model_fields_set else None
        known = knowledge(parameters)
        everything = not PARAMETERS.isdisjoint(parameters)

        def make() -> dict[str, Any]:
            return levels(
                assumed(*tables, source, everything=everything), *tables, **known
            )

        key = (*known.values(), everything, source, *map(id, tables))
        return alike("assumptions", key, make, *tables)

    def given(self) -> dict[str, Any]:
        """The keys that were given explicitly, as nested tables; they determine all others."""
        return self.model_dump(exclude_unset=True)

    def override(self, overrides: Changes) -> Scenario:
        """A copy with some keys changed, and with the values that depend on them updated."""
        return load(self, overrides)

    def where(self, table: str, key: str) -> str:
        """Location of a key for messages: in the scenario or among the overrides."""
        if (table, key) in self.__dict__.get("_changed", ()):
            return f"override {table}.{key}"
        return f"{self.name}: [{table}] {key}"

    def dump_toml(self, folder: Path | None = None, *, everything: bool = True) -> str:
        """The scenario as TOML, with all keys that have an effect; `load` restores it.

        Parameters
        ----------
        folder
            Folder of the future file. Paths of FMUs become relative to it, so that the text
            contains no absolute paths; None: paths are unchanged.
        everything
            Whether to write keys that were not given, too; those of ``[receiver]`` as comments,
            because they may differ for another receiver.
        """
        lines = [f"{key} = {toml(getattr(self, key))}" for key in ("name", "title", "seed", "fmi")]
        idle = self.idle()
        for name in ("time", "place", "target", "platform", "acoustics", "receiver"):
            table = getattr(self, name)
            if name == "place" and tracks.origin_of(table) is None:
                continue
            lines += ["", f"[{name}]"]
            for key in type(table).model_fields:
                value = getattr(table, key)
                if value is None or value == () or (key in PRIOR_KEYS and self.true_prior):
                    continue
                if not everything and key not in table.model_fields_set:
                    continue
                variable = table.variables.get(key)
                filled = variable is not None and key not in table.model_fields_set
                if filled and key == "seed":
                    continue  # if written, it would not follow the scenario's
                if filled and table.fmu is not None and variable.name not in SHARED_PARAMETERS:
                    continue  # a key in the file would have to be a parameter of that FMU
                if filled and ((name, key) in idle or effects.is_choice((name, key))):
                    continue  # when loaded, it would cause a warning, or count as a choice
                if filled and name == "acoustics" and key in water.of_profile(table):
                    continue  # when loaded, it would be refused beside the profile
                if key in FILES and folder is not None:
                    value = relative(Path(value), folder)
                mark = "# " if filled and name == "receiver" else ""
                lines.append(f"{mark}{key} = {toml(rows(variable, value))}")
        return "\n".join(lines) + "\n"

    def idle(self) -> dict[effects.Key, str]:
        """Keys of our components that have no effect in this scenario, each with the reason."""
        keys = [(name, key) for name, table in self._tables() for key in table.variables]
        return effects.idle(self, effects.components_of(self), keys)

    @property
    def beacons(self) -> int:
        """Number of beacons for which components are made."""
        return int(self.platform.beacons)

    @property
    def about_tracks(self) -> tuple[str, ...]:
        """What was kept of recorded tracks, a sentence for each."""
        return tuple(about for about, _ in self._followed().values())

    @property
    def recorded(self) -> Mapping[str, Mapping[str, Any]]:
        """Keys for the files of recorded tracks whose points are followed, by table."""
        return {name: keys for name, (_, keys) in self._followed().items()}

    def _followed(self) -> Mapping[str, tuple[str, Mapping[str, Any]]]:
        known: Mapping[str, Any] = self.__dict__.get("_tracks", {})
        return {n: it for n, it in known.items() if tracks.follows(n, getattr(self, n))}

    @property
    def true_prior(self) -> bool:
        """Whether the receivers' prior is the true start."""
        return bool(self.receiver.prior == TRUE)


# --- Reading -------------------------------------------------------------------------------------


def shipped() -> tuple[str, ...]:
    """Names of the shipped scenarios."""
    return library.shipped("sblcosim.scenario")


def shipped_text(name: str) -> str:
    """Text of a shipped scenario."""
    return (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")


def load(source: str | Path | Mapping[str, Any] | Scenario, overrides: Changes = ()) -> Scenario:
    """Read a scenario, fill in missing values, and check it.

    Parameters
    ----------
    source
        Name of a shipped scenario (``"paper-scenario-1"``), path of a TOML file, nested tables, or
        a scenario.
    overrides
        Keys to change: ``{"platform.arm_length_m": 0.4}``, also as nested tables or as
        ``keys.items()`` of any dict, or ``["platform.arm_length_m=0.4"]`` with values in TOML (a
        bare word is a string). A preset (``platform.beaufort``, ``platform.gps_grade``) replaces
        the keys that it sets, except those that are overridden too.

    Raises
    ------
    ConfigurationError
        The scenario does not exist or is invalid: one line per problem.
    """
    where, raw, file = _read(source)
    changed = override(raw, overrides)
    before: Mapping[str, Any] = source.__dict__ if isinstance(source, Scenario) else {}
    own = {name for name in tracks.FOLLOWERS if (name, "track_m") in changed}
    changed |= before.get("_changed", frozenset())
    if isinstance(source, str | Path):
        raw.setdefault("name", Path(source).stem)
    scenario = _validated(raw, where, changed)
    known = {name: it for name, it in before.get("_tracks", {}).items() if name not in own}
    for name in tracks.FOLLOWERS:
        table = getattr(scenario, name)
        try:
            found = tracks.followed(name, table, scenario.place)
        except TooFewError as error:
            raise ConfigurationError(cross_check(str(error), where, changed)) from None
        if found is None:
            continue
        given = given_of(table)
        tables, about = found
        known[name] = about, {key: given[key] for key in tracks.FILE_KEYS if key in given}
        scenario = _validated({**scenario.__dict__["_given"], **tables}, where, changed)
    scenario.__dict__["_tracks"] = known
    if file:
        files.note(scenario.name, file)
    scenario.__dict__["_file"] = file
    scenario.__dict__["_changed"] = frozenset(changed)  # not a field: it does not affect the run
    vain = effects.in_vain(scenario, effects.components_of(scenario), changed & SETTERS)
    if vain:
        raise ConfigurationError(
            "\n".join(f"{no_effect(key)}, as {why}" for key, why in sorted(vain.items()))
        )
    return scenario


def _validated(raw: Mapping[str, Any], where: str, changed: set[tuple[str, ...]]) -> Scenario:
    try:
        return Scenario.model_validate(raw)
    except ValidationError as error:
        fields = Scenario.model_fields
        wrong = [line for e in error.errors() for line in lines(e, where, changed, fields)]
        raise ConfigurationError("\n".join(wrong)) from None


SETTERS = {
    ("seed",), ("time", "sampling_time_s"), ("time", "ekf_ratio"),
    *((table, name) for name, table in PRESET_TABLES.items()),
}
"""Keys that only set other keys. If one sets none, the user is mistaken."""


def no_effect(key: effects.Key) -> str:
    """Start of the message about an override without effect."""
    return f"override {'.'.join(key)}: must have an effect, got none"


def _read(source: str | Path | Mapping[str, Any] | Scenario) -> tuple[str, dict[str, Any], str]:
    """Name of the source for messages, its content, and its file, if any."""
    if isinstance(source, Scenario):
        return source.name, {**source.__dict__["_given"]}, source.__dict__.get("_file", "")
    where, tables, folder = _tables_of(source)
    raw = without_none(tables)
    for table in raw.values():
        for key in FILES if isinstance(table, dict) else ():
            if isinstance(table.get(key), str):
                table[key] = str(folder / table[key])
    return where, raw, where if (folder / Path(where).name).is_file() else ""


def _tables_of(source: str | Path | Mapping[str, Any]) -> tuple[str, Mapping[str, Any], Path]:
    """Name of the source for messages, its tables, and the folder for relative paths."""
    if isinstance(source, Mapping):
        check_values("scenario", source)
        return "scenario", source, Path.cwd()
    if not isinstance(source, str | Path):
        raise ConfigurationError(
            "scenario: must be a name, a TOML file, tables or a loaded scenario, got "
            f"{instance(source)}"
        )
    path = Path(source)
    name = str(source).removesuffix(".toml")
    if name in shipped() and not os.path.isfile(path):
        path, text = Path(f"{name}.toml"), shipped_text(name)
    else:
        text = read_text(path, shipped())
    tables = parse(shown(path), text)
    fields = Scenario.model_fields
    if tables.keys() <= {key for key in fields if not is_table(fields, key)}:
        names = ", ".join(f"[{key}]" for key in fields if is_table(fields, key))
        raise ConfigurationError(f"{shown(path)}: must have at least one table ({names}), got none")
    return shown(path), tables, resolved(path).parent
