"""What receivers know about the start of a run, and the same start for all."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from sblcosim.models.declaration import number_of
from sblcosim.models.receiver.variables import INITIALISATION

from ...scenario.scenario import Scenario, load
from ...scenario.schema import PRIOR_KEYS
from ...study.campaign import prepare
from ...study.study import Study
from ...words.lists import listed, plural

_PRIOR = number_of(INITIALISATION, "prior")
_KEYS = ("prior", "initialisation", "prior_position_std_m", *PRIOR_KEYS)
"""Keys that set where a receiver begins."""


def evened(scenario: Scenario) -> Scenario:
    """The scenario, with receivers that begin with the first samples that they receive."""
    tables = scenario.given()
    receiver = tables.get("receiver", {})
    if not any(key in receiver for key in _KEYS):
        return scenario
    tables["receiver"] = {key: value for key, value in receiver.items() if key not in _KEYS}
    return load(tables)


def knowing(study: Study) -> list[str]:
    """Receivers of a study that are told where the diver begins, by their labels.

    They begin there: at the true position, or at one that the scenario gives. A receiver without a
    parameter for it, such as most of a user's own, begins with the first samples that it receives.
    """
    receiver = study.base.receiver
    if not study.base.true_prior and receiver.initialisation != "prior":
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they are issued when it runs
        campaign = prepare(study)
    components = campaign.points[0].system.components
    return [
        label for label in campaign.receivers
        if "prior_position" in (given := components[label].parameters)
        and given.get("initialisation", _PRIOR) == _PRIOR
    ]


def sentences(
    known: Mapping[str, Sequence[str]], receivers: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    """Remarks on receivers that begin with different knowledge, one line for each scenario.

    Parameters
    ----------
    known
        Receivers that know the start, by scenario.
    receivers
        All receivers that ran in it.
    """
    for place, told in known.items():
        others = [name for name in receivers[place] if name not in told]
        if told and others:
            verb, do = plural(len(told), "begins", "begin"), plural(len(others), "does", "do")
            knows = plural(len(told), "knows", "know")
            yield (
                f"{place}: {listed(told)} {knows} where the diver starts and {verb} there; "
                f"{listed(others)} {do} not; 'compare' with same-start lets all begin with what "
                "they receive first"
            )


def settings(studies: Sequence[Study]) -> dict[str, Any]:
    """Receivers that know the start, by the names of the scenarios."""
    return {study.base.name: knowing(study) for study in studies}
