"""A new scenario with the decisions that were typed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from sblcosim.models.receiver.receiver import Beacons

from ..errors import ConfigurationError, quoted
from . import effects
from .arrangement import errors_of
from .decisions import DECISIONS, Values, idle, value_of
from .scenario import Scenario, load
from .schema import PATH
from .tracks import FILE

_ENDLESS = ("white_noise_acceleration",)
_DURATION = 300.0
"""Duration [s] of a run whose path has no end."""


@dataclass(frozen=True)
class Decided:
    """A scenario with all decisions.

    Attributes
    ----------
    scenario
        The scenario, without keys that have lost their effect.
    kind
        Kind of its beacons.
    """

    scenario: Scenario
    kind: Beacons | None

    @property
    def open(self) -> list[str]:
        """Names of the decisions that there are."""
        return [name for name, it in DECISIONS.items() if it.moot(self.scenario, self.kind) is None]

    @property
    def keys(self) -> set[str]:
        """Keys of these decisions that have a value and an effect."""
        keys = [key for name in self.open for key in DECISIONS[name].keys(self.scenario)]
        without = idle(self.scenario, keys)
        return {
            key for key in keys if key not in without and value_of(self.scenario, key) is not None
        }


def decided(begin: Scenario, answers: Mapping[str, str]) -> Decided:
    """A scenario with decisions.

    Parameters
    ----------
    begin
        The scenario to begin with.
    answers
        What was typed, by the name of the decision.

    Raises
    ------
    ConfigurationError
        An answer cannot be read, or contradicts the scenario. Each line begins with the name of
        the decision.
    """
    scenario, kind = begin, errors_of(begin.platform)
    for name, it in DECISIONS.items():
        if name not in answers:
            continue
        why = it.moot(scenario, kind)
        if why is not None:
            got = quoted(answers[name])
            raise ConfigurationError(f"{name}: must be left out, as {why}, got {got}")
        try:
            values = it.read(answers[name], scenario)
        except ConfigurationError as error:
            raise ConfigurationError(f"{name}: {error}") from None
        try:
            scenario = load(scenario, values.items())
        except ConfigurationError as error:
            lines = (_about(name, values, begin, line) for line in str(error).splitlines())
            raise ConfigurationError("\n".join(dict.fromkeys(lines))) from None
    return Decided(load(scenario, _consequences(begin, scenario).items()), kind)


def _about(name: str, values: Values, begin: Scenario, line: str) -> str:
    """A message about the keys of a decision as one about the decision."""
    key = re.match(r"override (\w+\.\w+)", line)
    if key is not None and key[1] in values:
        return f"{name}{line[key.end() :]}"
    return f"{name}: {line.removeprefix(f'{begin.name}: ')}"


def _consequences(begin: Scenario, scenario: Scenario) -> Values:
    """Changes that follow from decisions.

    They are keys that have lost their effect, a title that tells another number of beacons, and the
    end of the run.
    """
    before, now = (
        idle(it, [".".join(key) for key in effects.given(it)]) for it in (begin, scenario)
    )
    changes: Values = dict.fromkeys(sorted(now.keys() - before.keys()))
    if scenario.platform.beacons != begin.platform.beacons:
        changes["title"] = ""
    target = scenario.target
    endless = target.trajectory in _ENDLESS or (target.trajectory != FILE and not target.speed_m_s)
    if endless and target.fmu is None and scenario.time.duration_s == PATH:
        changes["time.duration_s"] = _DURATION
    return changes
