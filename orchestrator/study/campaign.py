"""A resolved study: its points, the groups that run side by side, and its runs."""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus import unchanged
from sblcosim.fmus.host.nanoseconds import SECOND

from .. import artifacts
from ..errors import (
    ConfigurationError,
    ConfigurationWarning,
    NoEffectWarning,
    SblcosimError,
    check_choice,
)
from ..prepare.scenario import joined
from ..results.responses import Response
from ..scenario import effects, starts
from ..scenario.files import about
from ..scenario.labels import RAW
from ..scenario.scenario import Scenario, Source
from ..scenario.schema import CORE_COMPONENTS
from ..scenario.sources import Choice, choice_of
from ..scenario.wiring import no_effect
from ..simulation import execution
from ..simulation.children.process import check_patience, patience
from ..simulation.how import HOW, How
from ..simulation.plans.alike import alike
from ..simulation.plans.plan import Plan, PlannedComponent
from ..simulation.system import ComponentSpec, Connection, Likeness, System
from .definition import Definition
from .garbage import uncollected
from .groups import Group, PreparedPoint, grouped
from .stand_in import StandIn

Floats = NDArray[np.float64]
_Texts = dict[Hashable, Any]


@dataclass(frozen=True, eq=False)
class Campaign:
    """A resolved study.

    Attributes
    ----------
    groups
        None if a function replaces the simulation.
    receivers
        Labels of the receivers, or the function's name.
    seeded
        Components that get the run's seed.
    handovers
        Connections from the true start to the priors, for ``prior = "true"``.
    fmus
        SHA-256 that identifies the FMUs and the user's Python files, by component.
    step_timeout
        See `sblcosim.study.runner.run`.
    """

    study: Definition
    points: Sequence[PreparedPoint]
    groups: tuple[Group, ...]
    receivers: tuple[str, ...]
    seeded: tuple[str, ...]
    handovers: tuple[Connection, ...]
    fmus: Mapping[str, str]
    step_timeout: float | None = None

    @property
    def runs(self) -> int:
        """Total number of runs."""
        return len(self.points) * self.study.replicates

    @property
    def digest(self) -> str:
        """Hash of all that defines the runs but their number; point and replicate identify one."""
        digests = [point.digest for point in self.points]
        made_of: list[Any] = [self.study.seeding, self.study.seed, digests]
        if exact := self.study.rounded:
            made_of.append(exact)
        return hashlib.sha256(json.dumps(made_of).encode()).hexdigest()

    @property
    def steps(self) -> int:
        """Total number of communication steps."""
        return self.study.replicates * sum(self.weights.values())

    @cached_property
    def weights(self) -> Mapping[int, int]:
        """Communication steps of a run, by the index of its point; 1 for a function call."""
        if not self.groups:
            return dict.fromkeys(range(len(self.points)), 1)
        return {place: group.steps for group in self.groups for place in group.places}

    def definition(self) -> dict[str, Any]:
        """Definition of the runs, as plain data; equal for campaigns with equal runs."""
        study = self.study.model_dump(
            exclude={
                "title": True, "replicates": True, "scenario": True, "fixed": True,
                "factors": {"__all__": {"label", "unit"}},
                "conditions": {"__all__": {"label", "unit"}},
            }
        )
        if study["design"]["points"] is None:  # folders from before grids existed stay valid
            del study["design"]["points"]
        for entries in (study["factors"], study["conditions"]):
            for entry in entries.values():
                for name in [n for n, v in entry.items() if v is None]:
                    del entry[name]
        if not study["conditions"]:
            del study["conditions"]
        if study["design"]["base_rows"] is None:
            del study["design"]["base_rows"]
        del study["design"]["sample"]
        if self.study.sample is not None and self.study.sample.version > 1:
            study["design"]["sample"] = self.study.sample.version  # missing in older folders
        model = study.pop("model")
        if model is not None:
            study["model"] = {"from": model.origin, "sha256": model.sha256}
        study["receivers"] = [
            r if isinstance(r, str) else {"from": r.origin, "sha256": r.sha256}
            for r in self.study.receivers
        ]
        if study["responses"]:
            study["responses"] = [
                r.name if r.shipped else {"name": r.name, "from": r.origin, "sha256": r.sha256}
                for r in self.study.asked
            ]
        else:
            del study["responses"]
        content = {"study": study, "fmus": self.fmus}
        if model is None:
            content["scenario"] = self.study.base.given()
        plain: dict[str, Any] = artifacts.plain(content)
        return plain


@dataclass(frozen=True)
class CampaignRun:
    """A run. ``place`` is the index of its point, from 0; ``replicate`` counts from 1."""

    place: int
    replicate: int
    seed: int
    run_id: str


def prepare(study: Definition, how: How = HOW) -> Campaign:
    """Resolve and check all points.

    Raises
    ------
    ConfigurationError, FmuError
        A point cannot be run; the message names it.
    """
    if how.master is not None:
        check_choice("master", how.master, execution.MASTERS)
    study.check_code()
    if study.model is not None:
        return _of_function(study, study.model, how.step_timeout)
    check_patience(how.step_timeout)
    with about(study.__dict__.get("_file", "")), uncollected():
        return _prepared(study, how)


def _prepared(study: Definition, how: How) -> Campaign:
    with patience(how.step_timeout), unchanged.assumed():
        labels = tuple(label for label in choice_at_all_points(study).receivers if label != RAW)
        with _warnings_once(len(study.points.values)):
            keys: Mapping[effects.Key, str] = dict.fromkeys(effects.given(study.base), "")
            points, plans, texts = [], [], _Texts()
            for number, values in enumerate(study.points.values, 1):
                scenario, system, plan = resolved(study, number)
                if keys:
                    keys = effects.idle(scenario, study.components(scenario), keys)
                if number == 1:
                    seeded, handovers = seeded_inputs(study, system, labels)
                    free = {f"{name}.seed" for name in seeded} | {c.target for c in handovers}
                digest = point_digest(study, number, system, plan, free, texts)
                of_study = tuple(v if isinstance(v, str) else float(v) for v in values)
                points.append(PreparedPoint(number, of_study, system, digest))
                plans.append(plan)
    for line in no_effect(study.base, keys):  # keys without effect at any point
        warnings.warn(line, NoEffectWarning, stacklevel=2)
    _check_effects(study, points)
    alone = [r.name for r in study.asked if not r.in_lanes]
    if alone and how.master == "lanes":
        raise ConfigurationError(
            f"master: must not be lanes with a response that needs a record, got {alone[0]}"
        )
    fmus = {c.name: c.sha256 for c in plans[0].components if c.sha256}
    groups = grouped(points, plans, free, how.master, bool(alone))
    return Campaign(
        study, tuple(points), groups, labels, seeded, handovers, fmus, how.step_timeout
    )


def _of_function(study: Definition, model: StandIn, step_timeout: float | None) -> Campaign:
    """The campaign of a function that replaces the simulation."""
    points = [
        PreparedPoint(
            number, values, System({}, ()),
            hashlib.sha256(f"{model.sha256} {number} {study.at(number)}".encode()).hexdigest(),
        )
        for number, values in enumerate(study.points.values, 1)
    ]  # fmt: skip
    return Campaign(study, tuple(points), (), (model.name,), (), (), {}, step_timeout)


def point_digest(
    study: Definition,
    number: int,
    system: System,
    plan: Plan,
    free: Collection[str],
    texts: _Texts | None = None,
) -> str:
    """Hash of everything that affects the responses of a point, except the ``free`` parameters.

    Parameters
    ----------
    texts
        Texts that points with the same ``free`` share: components and connections by their ids and
        names, values of parameters by their `facts`.
    """
    known = {} if texts is None else texts
    digest = digest_of(system, plan, free, study.settling_ns, study.asked, known)
    if study.sample is None:
        return digest
    # Two rows of a space may have equal values and still be two of its runs.
    return hashlib.sha256(f"{digest} {number}".encode()).hexdigest()


def resolved_alone(study: Definition, number: int) -> tuple[Scenario, System, Plan]:
    """As `resolved`, but keys without effect, which may have one elsewhere, only warn."""
    scenario, system, plan = resolved(study, number)
    idle = effects.idle(scenario, study.components(scenario), effects.given(scenario))
    for line in no_effect(scenario, idle):
        warnings.warn(line, NoEffectWarning, stacklevel=2)
    return scenario, system, plan


def choice_at_all_points(study: Definition) -> Choice:
    """The components that run with a study's scenario, which no factor changes."""
    return alike("choice", id(study), lambda: choice_of(study.base, receivers_of(study)), study)


def resolved(study: Definition, number: int) -> tuple[Scenario, System, Plan]:
    """Resolve and check a design point."""
    try:
        choice = choice_at_all_points(study)
        scenario = study.base.override(study.overrides(number).items())
        system, plan = joined(scenario, choice, raw=False, tell_idle=False)
        length = plan.stop_ns - plan.start_ns
        if length <= study.settling_ns:
            raise ConfigurationError(
                f"settling_time_s: must be less than the length of the run ({length / SECOND:g} "
                f"s), got {study.settling_time_s}"
            )
    except SblcosimError as error:
        levels = study.at(number)
        point = f": point {number} ({levels})" if levels else ""
        lines = [f"{study.name}{point}: {line}" for line in str(error).splitlines()]
        raise type(error)("\n".join(lines)) from None
    return scenario, system, plan


@contextmanager
def _warnings_once(points: int) -> Iterator[None]:
    """Issue each warning once, with the number of points it applies to."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConfigurationWarning)
        yield
    counts = Counter((str(w.message), w.category) for w in caught)
    for (message, category), count in counts.items():
        at = f" (at {count} of {points} points)" if points > 1 else ""
        warnings.warn(f"{message}{at}", category, stacklevel=4)


def _check_effects(study: Definition, points: Iterable[PreparedPoint]) -> None:
    """Refuse factors that change nothing: their points would repeat the same runs."""
    first: dict[str, int] = {}
    for point in points if study.sample is None else ():
        if study.points.centre[point.number - 1]:
            continue
        other = first.setdefault(point.digest, point.number)
        if other != point.number:
            before = study.points.values[other - 1]
            differ = [
                name
                for name, one, two in zip(
                    study.varied, before, study.points.values[point.number - 1], strict=True
                )
                if one != two
            ]
            table = "conditions" if differ[0] in study.conditions else "factors"
            raise ConfigurationError(
                f"{study.name}: [{table}.{differ[0]}]: must change something in the runs, got "
                f"nothing between points {other} and {point.number}; is it set by another key?"
            )


def seeded_inputs(
    study: Definition, system: System, labels: Sequence[str]
) -> tuple[tuple[str, ...], tuple[Connection, ...]]:
    """Components that get the run's seed, and outputs handed over at the start of a run."""
    seeded = starts.seeded(study.base, system.components, labels)
    if not set(seeded) & set(CORE_COMPONENTS):
        raise ConfigurationError(
            f"{study.name}: seed: must be left to the study in at least one of "
            f"{', '.join(CORE_COMPONENTS)}, got a seed of its own in each"
        )
    return seeded, starts.handovers(study.base, system.components, labels)


def receivers_of(study: Definition) -> list[Source]:
    return list(study.receivers)


def digest_of(
    system: System,
    plan: Plan,
    free: Collection[str],
    settling_ns: int,
    asked: Iterable[Response],
    texts: _Texts,
) -> str:
    """Hash of everything that affects the responses, except the ``free`` parameters."""

    def text(thing: object, made: Callable[[], str], name: str = "") -> str:
        known: str | None = texts.get((id(thing), name))
        if known is None:
            known = texts[id(thing), name] = made()
        return known

    components = [
        text(system.components[c.name], partial(_about, c, system.components[c.name], free, texts),
             c.name)
        for c in sorted(plan.components, key=attrgetter("name"))
    ]
    connections = text(
        system.connections,
        lambda: json.dumps(sorted(f"{c.source} {c.target}" for c in system.connections)),
    )
    parts = [
        f'"components": {{{", ".join(components)}}}',
        f'"connections": {connections}',
        f'"free": {text(free, lambda: json.dumps(sorted(free)))}',
    ]
    responses = sorted(f"{r.name} {r.sha256}" for r in asked)
    if responses:
        parts.append(f'"responses": {json.dumps(responses)}')
    parts.append(f'"span_ns": [{plan.start_ns}, {plan.stop_ns}, {settling_ns}]')
    return hashlib.sha256(f"{{{', '.join(parts)}}}".encode()).hexdigest()


def _about(
    component: PlannedComponent, spec: ComponentSpec, free: Collection[str], texts: _Texts
) -> str:
    """Text of a component, for the hash."""
    own = f"{component.name}."
    like = spec.like or Likeness(spec)
    known = texts.get((id(like.to), own))
    if known is None:
        names = sorted(k for k in like.to.parameters if f"{own}{k}" not in free)
        known = texts[id(like.to), own] = _entries(like.to, names)
    parameters = {**known, **_entries(spec, like.but & known.keys())}
    return (
        f'{_json(component.name)}: {{"fmu": {_json(component.sha256 or component.origin)}, '
        f'"interval_ns": {component.interval_ns}, '
        f'"parameters": {{{", ".join(parameters.values())}}}}}'
    )


_encode = json.JSONEncoder(sort_keys=True).encode
_quoted = lru_cache(1024)(_encode)


def _entries(spec: ComponentSpec, names: Iterable[str]) -> dict[str, str]:
    """Texts of some parameters by name, for the hash."""
    return {name: f"{_quoted(name)}: {_json(spec.parameters[name])}" for name in names}


def _json(value: Any) -> str:
    # The format of the JSON encoder for numbers, of which there are many.
    return repr(value) if type(value) is float and math.isfinite(value) else _encode(value)


def batch(campaign: Campaign, first: int, replicates: int) -> list[CampaignRun]:
    """All points of some replicates."""
    runs: list[CampaignRun] = []
    for replicate in range(first, min(first + replicates, campaign.study.replicates + 1)):
        runs += [run_of(campaign, place, replicate) for place in range(len(campaign.points))]
    return runs


def run_of(campaign: Campaign, place: int, replicate: int) -> CampaignRun:
    """A run by the index of its point and its replicate."""
    point = campaign.points[place]
    seed = campaign.study.run_seed(point.number, replicate)
    return CampaignRun(place, replicate, seed, point.run_id(seed))
