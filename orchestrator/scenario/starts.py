"""The start of a run: its seeds, and what each receiver knows of where the diver starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import INITIALISATION

from ..simulation.system import ComponentSpec, Connection
from ..words.lists import listed, plural
from .scenario import Scenario
from .schema import CORE_COMPONENTS

_PRIOR = number_of(INITIALISATION, "prior")


def told(
    scenario: Scenario, components: Mapping[str, ComponentSpec], receivers: Collection[str]
) -> list[str]:
    """Receivers that are told where the diver starts, by their labels.

    They begin there: at the true position, or at one that the scenario gives. A receiver without a
    parameter for it, such as most of a user's own, begins with the first samples that it receives.

    Parameters
    ----------
    components
        The components of the run.
    receivers
        Labels of its receivers.
    """
    if not scenario.true_prior and scenario.receiver.initialisation != "prior":
        return []
    return [
        label for label in receivers
        if "prior_position" in (given := components[label].parameters)
        and given.get("initialisation", _PRIOR) == _PRIOR
    ]


def sentence(knowing: Sequence[str], receivers: Sequence[str]) -> str:
    """Who knows the start and who does not; empty if all begin alike."""
    others = [name for name in receivers if name not in knowing]
    if not knowing or not others:
        return ""
    verb, do = plural(len(knowing), "begins", "begin"), plural(len(others), "does", "do")
    knows = plural(len(knowing), "knows", "know")
    return (
        f"{listed(knowing)} {knows} where the diver starts and {verb} there; {listed(others)} {do} "
        "not; 'sblcosim compare --same-start' (in Python same_start=True) lets all begin with what "
        "they receive first"
    )


def seeded(
    scenario: Scenario, components: Mapping[str, ComponentSpec], receivers: Collection[str]
) -> tuple[str, ...]:
    """Components that get the seed of a run: those that draw and have none of their own.

    Parameters
    ----------
    components, receivers
        See `told`.
    """
    own = scenario.receiver.parameters or {}
    drawing = [
        *(n for n in CORE_COMPONENTS if "seed" not in getattr(scenario, n).model_fields_set),
        *(label for label in receivers if "seed" not in own),
    ]
    return tuple(name for name in drawing if "seed" in components[name].parameters)


def handovers(
    scenario: Scenario, components: Mapping[str, ComponentSpec], receivers: Collection[str]
) -> tuple[Connection, ...]:
    """True starts that a run hands to receivers before it begins.

    Parameters
    ----------
    components, receivers
        See `told`.
    """
    return tuple(
        Connection("target.position", f"{label}.prior_position")
        for label in receivers
        if scenario.true_prior and "prior_position" in components[label].parameters
    )
