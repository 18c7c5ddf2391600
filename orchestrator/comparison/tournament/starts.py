"""What receivers know about the start of a run, and the same start for all."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ...scenario import starts
from ...scenario.scenario import Scenario, load
from ...scenario.schema import PRIOR_KEYS
from ...study.campaign import prepare
from ...study.study import Study

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
    """Receivers of a study that are told where the diver starts, by their labels."""
    if not study.base.true_prior and study.base.receiver.initialisation != "prior":
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they are issued when it runs
        campaign = prepare(study)
    return starts.told(study.base, campaign.points[0].system.components, campaign.receivers)


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
        if said := starts.sentence(told, receivers[place]):
            yield f"{place}: {said}"


def settings(studies: Sequence[Study]) -> dict[str, Any]:
    """Receivers that know the start, by the names of the scenarios."""
    return {study.base.name: knowing(study) for study in studies}
