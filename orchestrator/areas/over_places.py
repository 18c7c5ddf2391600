"""What maps of areas and of distances have in common: divers who circle about places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import artifacts
from ..answer import Answer
from ..scenario.arrangement import has_own_errors
from ..scenario.scenario import Scenario
from ..words.lists import counted
from .possible import caveat

Floats = NDArray[np.float64]


def asked(
    kind: str, scenario: Scenario, receiver: str, settings: Mapping[str, Any], motion: str
) -> dict[str, Any]:
    """What is known of a manifest before the first run."""
    about = {
        "scenario_name": scenario.name, "receiver": receiver, "settings": settings,
        "motion": motion,
    }  # fmt: skip
    known: dict[str, Any] = artifacts.plain({kind: about, "scenario": scenario.dump_toml()})
    return known


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OverPlaces(Answer):
    """The error of a receiver at places where a diver circles.

    Attributes
    ----------
    scenario
        What was simulated: the given scenario, with a diver who circles about the origin. In a run,
        the circle is about the place.
    receiver
        Label of the receiver.
    settings
        The arguments of the call, with all defaults, as plain data.
    motion
        How the diver moves, in words.
    failures
        Messages of failed runs, with their number.
    doubt
        Why the receiver does not suit this motion, in words; empty if it does.
    left_out
        Estimated RMS of the errors that the possible error leaves out and that matter [m], keyed by
        a description; each as long as the table.
    """

    scenario: Scenario
    receiver: str
    settings: Mapping[str, Any]
    motion: str
    failures: Mapping[str, int]
    doubt: str = ""
    left_out: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def limit_m(self) -> float | None:
        """The requirement [m]."""
        limit: float | None = self.settings["limit_m"]
        return limit

    @property
    def reference_point(self) -> str:
        """The point about which the places lie, in words."""
        own = has_own_errors(self.scenario.platform)
        return "the middle of the beacons" if own else "the platform"

    def failed(self) -> Iterator[str]:
        """A remark for each message of failed runs."""
        for message, count in self.failures.items():
            yield f"{counted(count, 'run')} failed: {message}"

    def warned(self) -> Iterator[str]:
        """The remarks on the receiver and on what the possible error leaves out."""
        if self.doubt:
            yield self.doubt
        if self.left_out:
            yield caveat(self.left_out)

    def plain(self, own: Mapping[str, Any]) -> dict[str, Any]:
        """The common part and an answer's own as plain data."""
        plain: dict[str, Any] = artifacts.plain({
            "scenario_name": self.scenario.name, "receiver": self.receiver,
            "settings": self.settings, "motion": self.motion, **own, "failures": self.failures,
            "doubt": self.doubt or None, "caveat": caveat(self.left_out) or None,
        })  # fmt: skip
        return plain
