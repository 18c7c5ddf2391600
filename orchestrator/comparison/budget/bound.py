"""The possible error with each switch: the reference of `sblcosim.limits` along the same runs."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sblcosim.models.settings.parameters import STOCHASTIC

from ...api import run
from ...errors import SblcosimError
from ...limits.run import of_run
from ...limits.verdict import Possible
from ...results.result import Result
from ...scenario.scenario import Scenario, load

BOUND_RUNS = 3
"""Runs over which a bound is averaged; it hardly depends on the number."""
_RECEIVER = "multilateration"
_ALONG = re.compile(r"_amplitude_|wave_height|watch_circle|loss_probability|echo_probability")
"""Keys that change a path or the received samples."""


@dataclass(frozen=True)
class BoundBySwitch:
    """Mean squares [m²] by frame and switch; NaN where there is no accuracy.

    Attributes
    ----------
    kind
        ``bound`` or ``reference``.
    acceleration_psd
        q of the diver [m²/s³], the same with all switches; averaged over the runs.
    """

    squares: Mapping[str, Mapping[str, float]]
    kind: str
    acceleration_psd: float


def bounds(
    base: Scenario,
    switches: Mapping[str, Mapping[str, Any]],
    seed: int,
    acceleration_psd: float | None = None,
) -> BoundBySwitch | None:
    """The possible error with each switch; None if platform, acoustics or target are not ours.

    It is averaged over the first runs, beginning at the first fix of three ranges. Sources that
    change neither paths nor received samples are evaluated along the same run.

    Parameters
    ----------
    acceleration_psd
        q of the diver [m²/s³]; None: that of the path of each run, before anything is switched.
    """
    stochastic = base.target.trajectory == STOCHASTIC
    found: dict[str, list[Possible | None]] = {name: [] for name in switches}
    for one in range(seed, seed + BOUND_RUNS):
        q = None if stochastic else acceleration_psd
        results: dict[str, Result | None] = {}
        for name, overrides in switches.items():
            scenario = load(base.given(), {**overrides, "seed": one}.items())
            along = repr(sorted((k, v) for k, v in overrides.items() if _ALONG.search(k)))
            if along not in results:
                results[along] = _run(scenario)
            result = results[along]
            if result is None:
                return None
            epochs = result.record.estimates(_RECEIVER).epoch_ns
            limits = of_run(result.record, scenario, result.fmus, epochs, q)
            if limits is None:
                return None
            if not stochastic:  # the first switch is none
                q = limits.acceleration_psd
            found[name].append(limits.verdict(epochs))
    known = [v for verdicts in found.values() for v in verdicts if v is not None]
    if not known:
        return None
    squares = {
        frame: {
            name: float(np.mean([_square(v, attribute) for v in verdicts]))
            for name, verdicts in found.items()
        }
        for frame, attribute in (("absolute", "absolute_rms"), ("own_relative", "relative_rms"))
    }
    q = float(np.mean([v.acceleration_psd for v in known]))
    return BoundBySwitch(squares, known[0].kind, q)


def _run(scenario: Scenario) -> Result | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the receiver's runs have already issued the warnings
            return run(scenario, _RECEIVER)
    except SblcosimError:
        return None


def _square(verdict: Possible | None, attribute: str) -> float:
    known = verdict is not None and verdict.accuracy
    return float(getattr(verdict, attribute) ** 2) if known else float("nan")
