"""Errors in a study, as messages."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from difflib import get_close_matches
from functools import cache
from itertools import compress
from typing import Any

from pydantic_core import ErrorDetails

from ..errors import ConfigurationError, instance, nearest, quoted, shortened
from ..results.responses import ALL_PERCENTILES, ON_REQUEST, RESPONSES, Response
from ..scenario import effects
from ..scenario.messages import requirement
from ..scenario.scenario import SETTERS, Scenario, no_effect
from ..scenario.schema import Table, toml
from . import design as designs
from . import drawn
from .definition import Definition
from .design import INTERACTION_SIGN, Level
from .tables import (
    LONGEST_NAME,
    RECEIVERS_KEY,
    RESERVED,
    VARIED,
    ConditionTable,
    DesignTable,
    FactorTable,
    flat,
    named,
)


def problems(study: Definition) -> Iterator[str]:
    """Errors in a study; one line each."""
    known = known_keys()
    owner: dict[str, str] = {}
    wrong = [*_subject_problems(study)]
    if wrong:
        yield from wrong
        return
    if not study.factors and study.design.kind != "single":
        yield (
            "factors: must have at least one, got none; to replicate the unchanged scenario, set "
            "[design] kind = 'single'"
        )
    if study.factors and study.design.kind == "single":
        yield f"[design] kind: must not be 'single' with factors, got {', '.join(study.factors)}"
    yield from _names(study)
    fixed = {key for key, _ in flat(study.fixed)}
    if "seed" in fixed:
        yield "fixed: must not have seed, because the study's own seed takes precedence"
    for prefix, name, factor in _tables(study):
        if name == study.receiver_factor:
            if study.design.kind != "grid":
                yield (
                    f"{prefix} keys: must be keys of the scenario in a design of kind "
                    f"{study.design.kind!r}, got {RECEIVERS_KEY}; a grid may have it"
                )
            elif study.seeding != "common":
                yield (
                    "seeding: must be 'common' with receivers as a factor, as they run on the same "
                    f"noise, got {study.seeding!r}"
                )
            continue
        yield from _keys(prefix, name, factor, fixed, owner, study.model is None)
        if study.design.kind == "space" and name in study.factors:
            yield from _drawn(study, prefix, name, factor)
            continue
        if factor.distribution is not None:
            yield f"{prefix} distribution: must be left out, except in a space (kind = 'space')"
        elif factor.levels is None:
            yield f"{prefix} levels: must be given, got nothing"
        if factor.levels is None:
            continue
        try:
            if study.design.kind != "grid" and name in study.factors:
                _ = designs.Factor(name, tuple(map(named, factor.levels))).numbers
            designs.Factor(name, factor.values)
        except ConfigurationError as error:
            yield f"{prefix} levels: {str(error).partition(': ')[2]}"
            continue
        if study.model is not None:
            continue
        if not all(key in known or ".parameters." in key for key in factor.all_keys):
            continue
        problem = next((p for v in factor.values for p in _level(study, factor, v)), None)
        if problem is None and isinstance(factor.levels, dict) and factor.all_keys:
            problem = _twice(study, factor)
        if problem is not None:
            yield f"{prefix} levels: {problem}"
    yield from _design_problems(study)
    yield from _response_problems(study)


def _subject_problems(study: Definition) -> Iterator[str]:
    """Errors in the subject of a study: a scenario, or a function in its place; one line each."""
    if study.model is None:
        if not study.scenario:
            yield "scenario: must be given (or a model in its place), got nothing"
        return
    for key in ("scenario", "fixed", "receivers", "responses"):
        if getattr(study, key):
            yield f"{key}: must be left out with a model in place of the simulation"
    try:
        study.model.check([*study.varied])
    except ConfigurationError as error:
        yield str(error)


def _drawn(study: Definition, prefix: str, name: str, factor: FactorTable) -> Iterator[str]:
    """Errors in a factor of a space; one line each."""
    try:
        drawn.factor_of(name, factor, study.model is None)
    except ConfigurationError as error:
        yield f"{prefix} {str(error).removeprefix(f'factor {name}: ')}"
        return
    if study.model is None and factor.distribution == "choice":
        yield from (
            f"{prefix} levels: {problem}"
            for level in factor.values for problem in _level(study, factor, level)
        )


def _names(study: Definition) -> Iterator[str]:
    """Errors in the names and labels of factors and conditions; one line each."""
    called: dict[str, str] = {}
    names: set[str] = set()
    for prefix, name, factor in _tables(study):
        label = factor.label or name
        if label in called:
            yield f"{prefix} label: must differ from that of {called[label]}, got {quoted(label)}"
        if factor.label and (INTERACTION_SIGN.strip() in label or label in RESERVED):
            yield f"{prefix} label: must be a word or a few, got {quoted(label)}"
        called[label] = name
        if name in names and factor.label:
            yield f"{prefix}: must have another name than the factor, got {quoted(name)}"
        names.add(name)
        if not name.isidentifier() or name in RESERVED or len(name) > LONGEST_NAME:
            yield (
                f"{prefix}: must have a name of at most {LONGEST_NAME} letters, digits and _, "
                f"none of {', '.join(RESERVED)}, got {quoted(name)}"
            )


def _keys(
    prefix: str, name: str, factor: FactorTable, fixed: Collection[str], owner: dict[str, str],
    needed: bool,
) -> Iterator[str]:
    """Errors in the keys of a factor; one line each.

    Parameters
    ----------
    owner
        Owner of the keys that belong to other factors.
    needed
        Whether keys are required: a function has arguments instead.
    """
    known = known_keys()
    if not needed:
        if factor.all_keys:
            yield (
                f"{prefix} keys: must be left out with a model, whose arguments are the factors, "
                f"got {factor.all_keys[0]}"
            )
        return
    if isinstance(factor.levels, dict) and factor.keys:
        yield (
            f"{prefix} keys: must be left out with levels that have their own keys, got "
            f"{', '.join(factor.keys)}"
        )
    elif not factor.all_keys:
        yield f"{prefix} keys: must have at least one key, got none"
    for level in factor.levels if isinstance(factor.levels, dict) else ():
        if "." in level:
            yield f"{prefix} levels: must have names without a dot, got {quoted(level)}"
    for key in factor.all_keys:
        if key == RECEIVERS_KEY:
            yield f"{prefix} keys: {key} must be the only key of one factor, got it elsewhere"
            continue
        if key not in known and ".parameters." not in key:
            yield f"{prefix} keys: there is no key {quoted(key)}{_near(key, known)}"
            continue
        if key in owner:
            yield f"{prefix} keys: {key} must belong to one factor, also belongs to {owner[key]}"
        if key in fixed:
            yield f"{prefix} keys: {key} must not also be a fixed key"
        owner[key] = name


def _tables(study: Definition) -> Iterator[tuple[str, str, FactorTable]]:
    """All factors and conditions: their location, names and tables."""
    for table in VARIED:
        for name, factor in getattr(study, table).items():
            yield f"[{table}.{shortened(name)}]", name, factor


def _response_problems(study: Definition) -> Iterator[str]:
    """Errors in the responses; one line each."""
    seen: dict[str, Response] = {}
    for entry in study.responses:
        if isinstance(entry, Response):
            if seen.setdefault(entry.name, entry).sha256 != entry.sha256:
                yield f"responses: must have one response {entry.name}, got another of that name"
        elif entry in RESPONSES and entry not in ON_REQUEST:
            yield f"responses: must not have {entry}, which is always included"
        elif entry != ALL_PERCENTILES and entry not in ON_REQUEST:
            known = (*ON_REQUEST, ALL_PERCENTILES)
            close = nearest(entry, known) if isinstance(entry, str) else ""
            yield (
                "responses: must be names of responses or FILE.py:FUNCTION, got "
                f"{shortened(instance(entry))}{close}"
            )


def _design_problems(study: Definition) -> Iterator[str]:
    """Errors in the design; one line each."""
    if study.design.kind != "fraction" and (study.design.generators or study.design.resolution):
        yield "[design] kind: must be 'fraction' with generators or a resolution, got " + toml(
            study.design.kind
        )
    kind = toml(study.design.kind)
    for key in ("base_rows", "sample") if study.design.kind != "space" else ():
        if getattr(study.design, key) is not None:
            yield f"[design] kind: must be 'space' with {key}, got {kind}"
    if study.design.kind == "space" and (study.replicates > 1 or study.seeding == "common"):
        what = "replicates" if study.replicates > 1 else "seeding"
        yield f"{what}: must be left out in a space, where the seed is a factor"
    if study.design.kind != "grid" and study.design.points is not None:
        yield f"[design] kind: must be 'grid' with points, got {kind}"
    if study.design.kind not in ("full", "fraction") and study.design.centre_points:
        yield (
            f"[design] centre_points: must be 0 for kind '{study.design.kind}', got "
            f"{study.design.centre_points}"
        )
    if study.seeding == "common" and study.design.centre_points > 1:
        yield (
            "[design] centre_points: must be at most 1 with seeding 'common', where they would all "
            f"be the same run, got {study.design.centre_points}"
        )


def _level(study: Definition, factor: FactorTable, level: Level) -> Iterator[str]:
    """Errors in a single level. Levels that depend on other factors are checked later."""
    setting = factor.settings[level]
    try:
        study.base.override(setting.items())
    except ConfigurationError as error:
        for line in str(error).splitlines():
            if any(line.startswith(f"override {key}: must be") for key in setting):
                yield line.removeprefix("override ")


def _twice(study: Definition, factor: FactorTable) -> str | None:
    """Two levels with equal settings; an empty one is the unchanged scenario."""
    seen: dict[str, Level] = {}
    for level, setting in factor.settings.items():
        try:
            made = repr(study.base.override(setting.items()).model_dump(exclude={"name", "title"}))
        except ConfigurationError:
            continue  # depends on other factors
        if made in seen:
            empty = [name for name in (seen[made], level) if not factor.settings[name]]
            why = f" ({empty[0]}, which is empty, is the unchanged scenario)" if empty else ""
            return f"must have levels that differ, got {seen[made]} and {level} the same{why}"
        seen[made] = level
    return None


def idle_factors(study: Definition) -> Iterator[str]:
    """Keys of factors that have no effect at any point; one line each."""
    for prefix, name, factor in _tables(study):
        for key in factor.all_keys if name in study.varied else ():
            why = _why_idle(study, key)
            if why is not None:
                yield f"{prefix} keys: {key} must have an effect, got none, as {why}"


def _why_idle(study: Definition, key: str) -> str | None:
    """Why a key has no effect at any point; None if it has one."""
    path = tuple(key.split("."))
    on = set(effects.conditions(path))
    if not on and path not in SETTERS:
        return None
    decisive = {path, *on, *SETTERS}
    names = [
        any(tuple(k.split(".")) in decisive for k in factor.all_keys)
        for factor in study.varied.values()
    ]
    why, seen = None, set()
    for number, values in enumerate(study.points.values, 1):
        levels = tuple(compress(values, names))
        if levels in seen:
            continue
        seen.add(levels)
        try:
            scenario = study.base.override(study.overrides(number).items())
        except ConfigurationError as error:
            lead = f"{no_effect(path)}, as "
            reasons = [line for line in str(error).splitlines() if line.startswith(lead)]
            if not reasons:
                return None  # another check reports the error at this point
            why = reasons[0].removeprefix(lead)
            continue
        why = effects.in_vain(scenario, study.components(scenario), [path]).get(path)
        if why is None:
            return None
    return why


@cache
def known_keys() -> tuple[str, ...]:
    """Keys that a factor may vary, ``table.key``."""
    keys = []
    for name, field in Scenario.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Table):
            keys += [f"{name}.{key}" for key in kind.model_fields if key not in _NO_FACTORS]
    return tuple(keys)


_NO_FACTORS = ("seed", "fmi", "fmu", "parameters", "type", "prior")


def _near(key: str, known: Sequence[str]) -> str:
    """Suggest the nearest key; without a table, compare the names alone."""
    table, _, name = key.rpartition(".")
    same = [k for k in known if k.partition(".")[2] == name]
    if same:
        others = [k.partition(".")[2] for k in known if k.startswith(f"{table}.")]
        own = [f"{table}.{close}" for close in get_close_matches(name, others, n=2)]
        return f"; did you mean {' or '.join(map(repr, [*own, same[0]]))}?"
    if "." in key:
        return nearest(key, known)
    close = nearest(key, [k.partition(".")[2] for k in known])
    for k in known:
        if close == nearest(key, [k.partition(".")[2]]) != "":
            return f"; did you mean {k!r}?"
    return ""


_KINDS: dict[str, type[FactorTable]] = {"factors": FactorTable, "conditions": ConditionTable}


def line(error: ErrorDetails, where: str, top: type[Table] = Definition) -> str:
    """An error that pydantic found in a table, in our own wording."""
    location = [str(part) for part in error["loc"]]
    at, table = location[0], top
    if at == "design" and len(location) > 1:
        table, at, location = DesignTable, f"[design] {location[1]}", location[1:]
    elif at in _KINDS and len(location) > 2:
        table = _KINDS[at]
        at, location = f"[{at}.{shortened(location[1])}] {location[2]}", location[2:]
    elif at in _KINDS and len(location) == 2:
        at = f"[{at}.{shortened(location[1])}]"
    if error["type"] == "extra_forbidden":
        inside = "" if table is top else at.partition("] ")[0] + "] "
        close = nearest(location[0], table.model_fields)
        if not close and table is not top:
            close = f"; there are {', '.join(table.model_fields)}"
        return f"{where}: {inside}there is no key {quoted(location[0])}{close}"
    if error["type"] == "missing":
        return f"{where}: {at}: must be given, got nothing"
    if location[0] == "scenario":
        return f"{where}: scenario: must be a name, a file or a table, got {_text(error['input'])}"
    must, choices = requirement(error)
    got = error["input"]
    close = nearest(got, choices) if isinstance(got, str) else ""
    return f"{where}: {at}: {must}, got {_text(got)}{close}"


def _text(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return shortened(toml(value))
