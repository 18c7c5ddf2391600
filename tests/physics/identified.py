"""Simulated logs whose device is known, and how often intervals hold its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import sblcosim
from sblcosim.data.samples import NEEDED, OWN, Samples, of_record
from sblcosim.identification.device import YES, Assumed, Device, device_of
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import execute
from sblcosim.simulation.resolve import resolve

PSD = 0.002
OFFSET_M = 0.15
_DEPTH = {"depth_std_m": 0.05, "depth_bias_m": 0.05}
_RANDOM = {
    "trajectory": "random_path", "speed_m_s": 0.6, "box_m": [35.0, 35.0], "leg_length_m": 15.0,
    "path_length_m": 360.0, "depth_start_m": 8.0, "depth_end_m": 10.0, **_DEPTH,
}
_DRAWN = {
    "trajectory": "white_noise_acceleration", "acceleration_psd_m2_s3": PSD,
    "initial_position_m": [0.0, 5.0, 8.0], "initial_position_std_m": 5.0,
    "initial_velocity_std_m_s": 0.2, **_DEPTH,
}
_CLOCK = {"acoustics.clock_offset_std_s": 0.0, "acoustics.clock_drift_std_s_s": 0.0,
          "acoustics.clock_offset_s": OFFSET_M / 1500}
LOGS: dict[str, tuple[dict[str, Any] | None, dict[str, Any]]] = {
    "harbour-lbl": (None, {}),
    "random_path": (_RANDOM, {}),
    "model": (_DRAWN, {"time.duration_s": 300.0, "time.sampling_time_s": 0.5}),
}
"""Motion, and other keys: two divers who turn, and one whose motion is drawn from the model."""
TRUE = {
    "range_std": 0.1, "late_share": 0.05, "late_mean": 2.0, "range_scale": 1500 / 1510 - 1,
    "loss_share": 0.1, "loss_burst": 1 / 0.9, "depth_std": 0.05,
    **{f"range_offset[{i}]": OFFSET_M for i in range(1, 5)},
}
"""The device of all logs."""
SURVEY = Assumed(place_std=0.3, place_down_std=0.3)


def scenario_of(name: str, **changes: Any) -> sblcosim.Scenario:
    """The scenario of a log."""
    import tomllib

    target, more = LOGS[name]
    shipped = Path(sblcosim.__file__).parent / "scenario" / "shipped" / "harbour-lbl.toml"
    content = tomllib.loads(shipped.read_text("utf-8"))
    if target is not None:
        content["target"] = target
    return sblcosim.load(content, {**_CLOCK, **more, **changes})


def logs(name: str, runs: int, first: int = 1, **changes: Any) -> Iterator[Samples]:
    """Logs with consecutive seeds."""
    scenario = scenario_of(name, **changes)
    plan = resolve(connect(scenario, "long_baseline"))
    for begin in range(first, first + runs, 20):
        seeds = np.arange(begin, min(begin + 20, first + runs))
        outcome = execute(
            plan, {f"{c}.seed": seeds for c in ("target", "platform", "acoustics")},
            record=NEEDED, threads=1,
        )
        for run in range(len(seeds)):
            yield of_record(outcome.record(run), np.zeros((scenario.beacons, 3)), OWN)


def true_of(name: str) -> dict[str, float]:
    """The numbers of the device in a log, and of the motion if it has one."""
    return TRUE | ({"acceleration_psd": PSD} if name == "model" else {})


def coverage(name: str, runs: int, first: int = 1) -> dict[str, tuple[float, float, int]]:
    """By parameter: share of intervals that hold it, share of logs that tell it, logs told."""
    true = true_of(name)
    told, held = dict.fromkeys(true, 0), dict.fromkeys(true, 0)
    for samples in logs(name, runs, first):
        for number in device_of(samples, known=SURVEY).numbers:
            if number.parameter in true and number.told == YES:
                told[number.parameter] += 1
                held[number.parameter] += holds(number, true[number.parameter])
    return {n: (held[n] / max(told[n], 1), told[n] / runs, told[n]) for n in true}


def holds(number: Any, value: float) -> bool:
    """Whether an interval holds a value."""
    return bool(number.low <= value <= number.high)


def told_of(device: Device) -> dict[str, str]:
    """Whether the log tells each parameter."""
    return {n.parameter: n.told for n in device.numbers}


# --- Platforms and buoys --------------------------------------------------------------------------

_POSE = ("acoustics.ping_platform_position", "acoustics.ping_platform_attitude")
_AT_ONCE = {"acoustics.clock_offset_std_s": 0.0}
CARRIED: dict[str, tuple[str, dict[str, Any]]] = {
    "platform": ("realistic-dive", {}),
    "harbour": ("harbour-square", {}),
    "paper": ("paper-scenario-1", {}),
    "buoys": ("gps-buoys", {**_AT_ONCE, "target.speed_m_s": 0.2}),
    "buoys of a fast GPS": ("gps-buoys", {
        **_AT_ONCE, "platform.gps_horizontal_std_m": 0.3,
        "platform.gps_horizontal_markov_std_m": 0.6, "platform.gps_correlation_time_s": 20.0,
    }),
}
"""Scenarios of beacons on a platform or below buoys, and changed keys."""


def carried(name: str) -> sblcosim.Scenario:
    """A scenario of `CARRIED`."""
    shipped, changes = CARRIED[name]
    return sblcosim.load(shipped, changes)


def true_numbers(scenario: sblcosim.Scenario) -> dict[str, float]:
    """The numbers of a scenario's device; a part that it lacks has the number 0."""
    a, t, p = scenario.acoustics, scenario.target, scenario.platform
    assumed = a.assumed_sound_speed_m_s
    return {
        "range_std": a.range_std_m, "late_share": a.outlier_probability,
        "late_mean": a.outlier_mean_m, "range_scale": assumed / a.sound_speed_m_s - 1,
        "loss_share": a.loss_probability, "loss_burst": 1 / (1 - a.loss_probability),
        "depth_std": t.depth_std_m, "gps_std": p.gps_horizontal_std_m,
        "gps_markov_std": p.gps_horizontal_markov_std_m,
        "gps_correlation_time": p.gps_correlation_time_s,
        **{f"range_offset[{i + 1}]": a.clock_offset_s * assumed for i in range(scenario.beacons)},
    }


def missed(name: str, runs: int, first: int = 1) -> dict[str, tuple[int, int]]:
    """By parameter: intervals that do not hold it, and logs that tell it."""
    scenario = carried(name)
    true, counts = true_numbers(scenario), {}
    for seed in range(first, first + runs):
        for n in sblcosim.identify(sblcosim.run(scenario, overrides={"seed": seed})).device.numbers:
            if n.parameter in true and n.told == YES:
                off, told = counts.get(n.parameter, (0, 0))
                counts[n.parameter] = off + (not holds(n, true[n.parameter])), told + 1
    return counts
