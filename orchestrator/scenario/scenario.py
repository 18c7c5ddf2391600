"""Scenario files: everything about a run in one TOML text, with units in its keys.

What a file leaves out is filled in when it is loaded, so a `Scenario` states every number of its
run.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails
from sblcosim.fmus.host.nanoseconds import SECOND, is_whole_ns, nanoseconds
from sblcosim.models import COMPONENTS, RECEIVERS

from ..errors import ConfigurationError, instance, nearest, quoted, shortened
from ..simulation.system import PythonComponent, System
from . import effects
from .reading import check_values, parse, read_text, shown
from .schema import (
    ANYWHERE,
    PRESETS,
    PRIOR_KEYS,
    SEED,
    TRUE,
    Acoustics,
    Name,
    Platform,
    Receiver,
    Table,
    Target,
    Time,
    default,
    divides,
    preset,
    rows,
    toml,
)

_SHIPPED = resources.files("sblcosim.scenario") / "shipped"

Source = str | Path | Callable[[], PythonComponent]
"""What to use as a component: a receiver's name, an FMU file, or what makes a Python component."""
Receivers = Source | Sequence[Source] | Mapping[str, Source]
"""One or more receivers, with labels if it is a mapping."""
Overrides = Mapping[str, Any] | Iterable[str]
"""``{"platform.arm_length_m": 0.4}``, nested tables, or ``["platform.arm_length_m=0.4"]``."""


class Scenario(Table):
    """A run, completely.

    Made by `load`; all values that a file leaves out are filled in.

    Attributes
    ----------
    name, title
        For people and for the folder of results.
    seed
        Of all random numbers; a component may have its own.
    fmi
        FMI version (2 or 3) of the components.
    time, target, platform, acoustics, receiver
        The tables. Keys are those of a scenario file: ``scenario.platform.arm_length_m``.
    """

    name: Name = "scenario"
    title: str = ""
    seed: Annotated[int, Field(ge=SEED.min, le=SEED.max)] = int(SEED.starts[0])
    fmi: Literal[2, 3] = 2
    time: Time = Field(default_factory=Time)
    target: Target = Field(default_factory=Target)
    platform: Platform = Field(default_factory=Platform)
    acoustics: Acoustics = Field(default_factory=Acoustics)
    receiver: Receiver = Field(default_factory=Receiver)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Fill in what was not given, then check what several keys say together."""
        common = {"sampling_time_s": self.time.sampling_time_s, "seed": self.seed}
        presets: dict[str, Any] = {}
        for name in PRESETS:
            value = getattr(self.platform, name)
            if value is not None:
                presets |= preset(name, value)
        if self.target.waypoint_m:
            presets["waypoint_count"] = len(self.target.waypoint_m) // 3
        for name, table in self._tables("target", "platform", "acoustics"):
            table.fill(
                {**_starts(name)}
                | {k: v for k, v in presets.items() if k in table.variables}
                | common
            )
            table.fill({"interval_s": self.acoustics.sampling_time_s or common["sampling_time_s"]})
        self._complete_receiver()
        problems = [*self._problems()]
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def _complete_receiver(self) -> None:
        receiver = self.receiver
        if receiver.type is None and receiver.fmu is None:
            receiver.fill({"type": "ekf"})
        update = nanoseconds(self.time.sampling_time_s) * self.time.ekf_ratio / SECOND
        levels = {"range_std_m": self.acoustics.range_std_m, "depth_std_m": self.target.depth_std_m}
        derived = {
            key: max(level, receiver.variables[key].min or 0.0) for key, level in levels.items()
        }
        derived["update_interval_s"] = update
        if receiver.prior == TRUE:
            derived["initialisation"] = "prior"
        if receiver.type in RECEIVERS:
            known = _starts(receiver.type)
            derived = {**known} | {k: v for k, v in derived.items() if k in known}
        receiver.fill(derived)
        receiver.fill({"interval_s": receiver.update_interval_s})

    def _problems(self) -> Iterator[str]:
        """What contradicts something else; one line each."""
        receiver = self.receiver
        for name, table in (("time", self.time), *self._tables()):
            for key in ("sampling_time_s", "update_interval_s", "interval_s"):
                if key in table.model_fields_set and not is_whole_ns(getattr(table, key)):
                    yield (
                        f"[{name}] {key}: must be a whole number of nanoseconds, "
                        f"got {getattr(table, key)!r}"
                    )
        for name, table in self._tables():
            if table.fmu is None and table.parameters:
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
        target = self.target
        count = len(target.waypoint_m) // 3
        if target.trajectory == "waypoints" and not 2 <= target.waypoint_count <= count:
            given = "waypoint_count" in target.model_fields_set
            as_many = f", and as many as waypoint_count ({target.waypoint_count})" if given else ""
            yield f"[target] waypoint_m: must have at least 2 rows{as_many}, got {count}"

    def _tables(self, *names: str) -> Iterator[tuple[str, Any]]:
        for name in names or ("target", "platform", "acoustics", "receiver"):
            yield name, getattr(self, name)

    def given(self) -> dict[str, Any]:
        """What was given by hand, as nested tables; the rest follows from it."""
        return self.model_dump(exclude_unset=True)

    def override(self, overrides: Overrides) -> Scenario:
        """Another scenario with some keys changed; what depends on them follows."""
        return load(self, overrides)

    def where(self, table: str, key: str) -> str:
        """Where a key stands, for messages: in the scenario, or among the overrides."""
        if (table, key) in self.__dict__.get("_changed", ()):
            return f"override {table}.{key}"
        return f"{self.name}: [{table}] {key}"

    def dump_toml(self, folder: Path | None = None) -> str:
        """The scenario as TOML, with all keys that have an effect; `load` gives the same back.

        Parameters
        ----------
        folder
            Where the text is to be a file. Paths of FMUs become relative to it, so that nothing in
            the text depends on where both lie; None: they stay as they are.
        """
        lines = [f"{key} = {toml(getattr(self, key))}" for key in ("name", "title", "seed", "fmi")]
        idle = self.idle()
        for name in ("time", "target", "platform", "acoustics", "receiver"):
            table = getattr(self, name)
            lines += ["", f"[{name}]"]
            for key in type(table).model_fields:
                value = getattr(table, key)
                if value is None or value == () or (key in PRIOR_KEYS and self.true_prior):
                    continue
                variable = table.variables.get(key)
                filled = variable is not None and key not in table.model_fields_set
                if filled and table.fmu is not None and variable.name not in ANYWHERE:
                    continue  # what a file says must be a parameter of that FMU
                if filled and (name, key) in idle:
                    continue  # somebody would have to be warned of it
                if key == "fmu" and folder is not None:
                    value = _relative(Path(value), folder)
                lines.append(f"{key} = {toml(rows(variable, value))}")
        return "\n".join(lines) + "\n"

    def system(
        self,
        receivers: Receivers = (),
        fmi: int | None = None,
        components: Mapping[str, Source] | None = None,
    ) -> System:
        """Choose and connect the components; see `sblcosim.scenario.wiring.connect`."""
        from .wiring import connect

        return connect(self, receivers, fmi, components)

    def idle(self) -> dict[effects.Key, str]:
        """Keys of our components that have no effect in this scenario, and why."""
        keys = [(name, key) for name, table in self._tables() for key in table.variables]
        return effects.idle(self, effects.components_of(self), keys)

    @property
    def true_prior(self) -> bool:
        """Whether the receivers are told the true start."""
        return bool(self.receiver.prior == TRUE)


@cache
def _starts(component: str) -> Mapping[str, Any]:
    """A component's parameters where nothing is said of them."""
    made = COMPONENTS[component]
    return MappingProxyType({v.key: default(made, v) for v in made.of("parameter")})


def _relative(file: Path, folder: Path) -> str:
    """The path of a file as seen from a folder."""
    try:
        # The file itself may be a link: its own name is kept.
        relative = os.path.relpath(file.parent.resolve() / file.name, folder.resolve())
    except ValueError:  # on another drive
        return str(file)
    return Path(relative).as_posix()


# --- Reading -------------------------------------------------------------------------------------


@cache
def shipped() -> tuple[str, ...]:
    """Names of the scenarios that come with the project."""
    return tuple(sorted(f.name.removesuffix(".toml") for f in _SHIPPED.iterdir()))


def shipped_text(name: str) -> str:
    """Text of a scenario that comes with the project."""
    return (_SHIPPED / f"{name}.toml").read_text(encoding="utf-8")


def load(source: str | Path | Mapping[str, Any] | Scenario, overrides: Overrides = ()) -> Scenario:
    """Read a scenario, fill in what it leaves out, and check it.

    Parameters
    ----------
    source
        Name of a scenario that comes with the project (``"paper-scenario-1"``), path of a TOML
        file, nested tables, or a scenario.
    overrides
        Keys to change: ``{"platform.arm_length_m": 0.4}``, nested tables, or
        ``["platform.arm_length_m=0.4"]`` with values in TOML (a bare word is a string). A preset
        (``platform.beaufort``, ``platform.imu_grade``) replaces the keys that it sets, but for
        those among the overrides.

    Raises
    ------
    ConfigurationError
        There is no such scenario, or something in it is wrong: one line per problem.
    """
    where, raw, folder = _read(source)
    raw = _without_none(raw)
    for table in raw.values():
        if isinstance(table, dict) and isinstance(table.get("fmu"), str):
            table["fmu"] = str(folder / table["fmu"])
    changed: set[tuple[str, ...]] = set()
    if isinstance(source, Scenario):
        changed |= source.__dict__.get("_changed", frozenset())
    if isinstance(overrides, Mapping):
        check_values("overrides", overrides)
    batch = list(_pairs(overrides))
    for path, value in batch:
        check_values(f"override {shortened('.'.join(path))}", value, len(path))
    changed |= {path for path, _ in batch}
    _clear_for_presets(raw, batch)
    for path, value in batch:
        table = raw
        for part in path[:-1]:
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise ConfigurationError(
                    f"override {shortened('.'.join(path))}: {shortened(part)} must be a table"
                )
        is_file = path[-1] == "fmu" and isinstance(value, str)
        table[path[-1]] = str(Path(value).resolve()) if is_file else value
    if isinstance(source, str | Path) and "name" not in raw:
        raw["name"] = Path(source).stem
    try:
        scenario = Scenario.model_validate(_without_none(raw))
    except ValidationError as error:
        lines = [line for e in error.errors() for line in _lines(e, where, changed)]
        raise ConfigurationError("\n".join(lines)) from None
    scenario.__dict__["_changed"] = frozenset(changed)  # no field: it is no part of what is run
    vain = effects.in_vain(scenario, effects.components_of(scenario), changed & SETTERS)
    if vain:
        raise ConfigurationError(
            "\n".join(f"{no_effect(key)}, as {why}" for key, why in sorted(vain.items()))
        )
    return scenario


SETTERS = {
    ("seed",), ("time", "sampling_time_s"), ("time", "ekf_ratio"),
    *(("platform", name) for name in PRESETS),
}
"""Keys that do nothing but set others: one that sets none was not meant so."""


def no_effect(key: effects.Key) -> str:
    """The beginning of a message about a key that is overridden in vain."""
    return f"override {'.'.join(key)}: must have an effect, got none"


def _clear_for_presets(
    raw: Mapping[str, Any], batch: Iterable[tuple[tuple[str, ...], Any]]
) -> None:
    """What is said later wins: remove the keys that the presets of a batch replace."""
    said = dict(batch)
    table = raw.get("platform")
    for name, keys in PRESETS.items():
        if said.get(("platform", name)) is not None and isinstance(table, dict):
            for key in keys:
                table.pop(key, None)


def _without_none(tables: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of nested tables without the keys that hold nothing."""
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in tables.items()
        if value is not None
    }


def _read(source: str | Path | Mapping[str, Any] | Scenario) -> tuple[str, Mapping[str, Any], Path]:
    """Where it comes from, the tables, and the folder of relative paths."""
    if isinstance(source, Scenario):
        return source.name, source.given(), Path.cwd()
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
    if tables.keys() <= {key for key in Scenario.model_fields if not _is_table(key)}:
        names = ", ".join(f"[{key}]" for key in Scenario.model_fields if _is_table(key))
        raise ConfigurationError(f"{shown(path)}: must have at least one table ({names}), got none")
    return shown(path), tables, path.resolve().parent


def _pairs(overrides: Overrides) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Keys as paths, and their values."""
    if isinstance(overrides, str):
        overrides = (overrides,)
    if not isinstance(overrides, Iterable):
        raise ConfigurationError(
            "overrides: must be keys with values, or texts like table.key=value, got "
            f"{instance(overrides)}"
        )
    if isinstance(overrides, Mapping):
        for key, value in overrides.items():
            path = tuple(str(key).split("."))
            if isinstance(value, Mapping) and path[-1] != "parameters":
                for rest, inner in _pairs(value):
                    yield path + rest, inner
            else:
                yield path, value
        return
    for item in overrides:
        if not isinstance(item, str):
            raise ConfigurationError(
                f"override: must be a text like table.key=value, got {instance(item)}"
            )
        key, equals, text = item.partition("=")
        if not equals or not key.strip():
            raise ConfigurationError(
                f"override: must be table.key=value, got {quoted(item)}"
            )
        yield tuple(part.strip() for part in key.split(".")), _toml_or_word(key, text.strip())


def _toml_or_word(key: str, text: str) -> Any:
    try:
        (value,) = tomllib.loads(f"value = {text}").values()
    except (ValueError, RecursionError):
        if re.fullmatch(r"[A-Za-z_./~\\][\w./~\\:-]*", text):
            return text
        raise ConfigurationError(
            f"override {shortened(key.strip())}: must be a value in TOML, got "
            f"{quoted(text)}"
        ) from None
    return value


# --- Messages ------------------------------------------------------------------------------------


def _lines(error: ErrorDetails, where: str, changed: set[tuple[str, ...]]) -> Iterator[str]:
    """A problem that pydantic found, in our wording."""
    location = error["loc"]
    if not location:
        for line in str(error["ctx"]["error"]).splitlines():
            yield _cross_check(line, where, changed)
        return
    table, key = str(location[0]), ".".join(str(part) for part in location[1:2])
    if any(path[: len(location[:2])] == location[:2] for path in changed):
        where = place = f"override {shortened('.'.join((table, key)) if key else table)}"
    elif key:
        place = f"{where}: [{table}] {key}"
    else:
        place = f"{where}: {f'[{table}]' if _is_table(table) else table}"
    if error["type"] == "extra_forbidden":
        yield f"{where}: {_unknown(location)}"
        return
    must, choices = requirement(error)
    got = error["input"]
    close = nearest(got, choices) if isinstance(got, str) else ""
    yield f"{place}{_element(location)}: {must}, got {shortened(toml(got))}{close}"


def _cross_check(line: str, where: str, changed: set[tuple[str, ...]]) -> str:
    """What contradicts something else, with the override that it is about, if it is about one."""
    match = re.match(r"\[(\w+)\](?: (\w+))?: ", line)
    if match is not None:
        table, keys = match[1], (match[2],) if match[2] else ("fmu", "type")
        for key in keys:
            if (table, key) in changed:
                return f"override {table}.{key}: {line[match.end() :]}"
    return f"{where}: {line}"


def requirement(error: ErrorDetails) -> tuple[str, list[str]]:
    """What must hold, and the valid names if it is a choice."""
    context = error.get("ctx", {})
    kind = error["type"]
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", context["expected"])
        return f"must be {context['expected']}", choices
    wording = {
        "float_type": "must be a number",
        "finite_number": "must be a finite number",
        "int_type": "must be a whole number",
        "int_from_float": "must be a whole number",
        "bool_type": "must be true or false",
        "string_type": "must be a string",
        "tuple_type": "must be an array",
        "dict_type": "must be a table",
        "model_type": "must be a table",
        "greater_than_equal": "must be at least {ge}",
        "less_than_equal": "must be at most {le}",
        "greater_than": "must be more than {gt}",
    }
    return wording.get(kind, error["msg"]).format(**context), []


def _is_table(name: Any) -> bool:
    field = Scenario.model_fields.get(str(name))
    return (
        field is not None
        and isinstance(field.annotation, type)
        and issubclass(field.annotation, Table)
    )


def _element(location: Sequence[str | int]) -> str:
    """Index of the element of an array, as in FMI: 1-based."""
    if len(location) < 3 or not isinstance(location[2], int):
        return ""
    table = Scenario.model_fields[str(location[0])].annotation
    variable = getattr(table, "variables", {}).get(location[1])
    if variable is None:
        return ""
    return str(variable.elements[location[2]].removeprefix(variable.name))


def _unknown(location: Sequence[str | int]) -> str:
    """An unknown key or table, with the nearest valid one."""
    tables = {
        name: list(field.annotation.model_fields)
        for name, field in Scenario.model_fields.items()
        if _is_table(name) and isinstance(field.annotation, type)
    }
    name = str(location[-1])
    if len(location) == 1:
        homes = [table for table, keys in tables.items() if name in keys]
        if homes:
            return f"key {name!r} must stand in the table [{homes[0]}]"
        return f"there is no key or table {quoted(name)}" + nearest(
            name, Scenario.model_fields
        )
    table = str(location[0])
    close = nearest(name, tables[table])
    homes = [other for other, keys in tables.items() if name in keys]
    if homes:
        close = f"; did you mean {name!r} in [{homes[0]}]?"
    elif not close:
        # A longer or a shorter name of the same thing: "arm" for "arm_length_m".
        parts = [key for key in tables[table] if name.lower() in key.lower()]
        close = f"; did you mean {parts[0]!r}?" if parts else ""
    return f"[{table}] has no key {quoted(name)}{close}"
