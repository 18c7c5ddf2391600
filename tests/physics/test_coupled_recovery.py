"""How the coupled filter comes back after things that its model does not know of.

The realistic dive is simulated once per seed; then what the receiver hears is tampered with, and
the filter's equations are stepped on it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import sblcosim
from numpy.typing import NDArray
from sblcosim.models.loading import load as load_model
from sblcosim.models.ports import DEPTH, PING_POSE, RECEPTION
from sblcosim.scenario.wiring import connect
from sblcosim.simulation.masters.lanes import RunsOutcome, execute
from sblcosim.simulation.resolve import resolve
from stepper import Stepper

Floats = NDArray[np.float64]
Inputs = dict[str, NDArray[Any]]
Tamper = Callable[[Inputs, Floats], None]

RUNS = 50
STEPS = 330
BEGIN, END = 150.0, 170.0
PACKET = ("range", "range_epoch", "ping_beacon_position", "ping_platform_position",
          "ping_platform_attitude", "arrival_epoch")
_model = cache(load_model)


@cache
def dives() -> tuple[RunsOutcome, dict[str, Any]]:
    """What is heard in `RUNS` realistic dives, and the filter's parameters."""
    plan = resolve(connect(sblcosim.load("realistic-dive"), "coupled"))
    record = [f"acoustics.{v.name}" for v in (*RECEPTION, *PING_POSE)]
    record += [*(f"target.{v.name}" for v in DEPTH), "target.position"]
    seeds = np.arange(1, RUNS + 1)
    names = ("target", "platform", "acoustics")
    outcome = execute(plan, {f"{name}.seed": seeds for name in names}, record=record)
    component = next(c for c in plan.components if c.name == "coupled")
    ports = {s.port.name: s.values for s in component.settings}
    shapes = {v.name: v.shape for v in _model("coupled").component.of("parameter")}
    return outcome, {k: np.reshape(v, shapes[k]) if shapes[k] else v[0] for k, v in ports.items()}


def error_of(run: int, tamper: Tamper) -> Floats:
    """Error [m] of the newest estimate at each instant; NaN before the first."""
    outcome, parameters = dives()
    truth = outcome.values["target.position"][run]
    inputs = {
        name.partition(".")[2]: values[run].copy()
        for name, values in outcome.values.items() if name != "target.position"
    }
    time = outcome.time_ns / 1e9
    tamper(inputs, time)
    box = Stepper(_model("coupled"), parameters)
    error = np.full(STEPS, np.nan)
    step = int(outcome.time_ns[1] - outcome.time_ns[0])
    for k in range(STEPS):
        box.set(**{name: values[k] for name, values in inputs.items()})
        y = box.step(int(outcome.time_ns[k]), step)
        if y["update_count"]:
            # An estimate of an older epoch is all there is now.
            error[k] = np.linalg.norm(y["position"] - truth[k])
    return error


def heard_only(inputs: Inputs, hears: Callable[[int, int], bool]) -> None:
    """Take away the packets, each by its row and beacon, that are not heard."""
    count = inputs["reception_count"].copy()
    source = {name: inputs[name].copy() for name in (*PACKET, "packet_beacon_position")}
    current = {name: source[name][0].copy() for name in source}
    heard = np.zeros(count.shape[1], int)
    for k in range(len(count)):
        for beacon in range(count.shape[1]):
            if k and count[k, beacon] != count[k - 1, beacon] and hears(k, beacon):
                for name in PACKET:
                    current[name][beacon] = source[name][k, beacon]
                current["packet_beacon_position"] = source["packet_beacon_position"][k].copy()
                heard[beacon] += 1
        for name, values in current.items():
            inputs[name][k] = values
        inputs["reception_count"][k] = heard


def nothing(inputs: Inputs, time: Floats) -> None:
    """The dive as it is."""


def silence(inputs: Inputs, time: Floats) -> None:
    """No packet for 60 s."""
    heard_only(inputs, lambda k, beacon: not END - 60 <= time[k] < END)


def two_beacons(inputs: Inputs, time: Floats) -> None:
    """Two beacons only for 60 s."""
    heard_only(inputs, lambda k, beacon: beacon < 2 or not END - 60 <= time[k] < END)


def stolen(inputs: Inputs, time: Floats) -> None:
    """A beacon that is never heard."""
    heard_only(inputs, lambda k, beacon: beacon != 2)


def late(inputs: Inputs, time: Floats) -> None:
    """All ranges too long by 5 m for 20 s."""
    epoch = inputs["range_epoch"]
    inputs["range"] += 5.0 * ((epoch >= BEGIN) & (epoch < END))


def gps_jump(inputs: Inputs, time: Floats) -> None:
    """The platform says that it is 10 m farther north for 20 s."""
    epoch = inputs["range_epoch"]
    off = 10.0 * ((epoch >= BEGIN) & (epoch < END))
    inputs["ping_platform_position"][:, :, 0] += off
    inputs["ping_beacon_position"][:, :, 0] += off
    inputs["packet_beacon_position"][:, :, 0] += off.max(axis=1, keepdims=True) * (
        epoch.max(axis=1, keepdims=True) < END
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tamper", "after_s"),
    [(silence, 20.0), (two_beacons, 40.0), (stolen, 0.0), (late, 40.0), (gps_jump, 20.0)],
)
def test_it_comes_back_in_a_stated_time(tamper: Tamper, after_s: float) -> None:
    """Back is an RMS over the runs within 1.5 times that of the dive as it is; none stays lost."""
    plain = np.array([error_of(run, nothing) for run in range(RUNS)])
    found = np.array([error_of(run, tamper) for run in range(RUNS)])
    from_row = int(END + after_s)
    usual = np.sqrt(np.mean(plain[:, from_row : from_row + 60] ** 2))
    spans = [(0, 10), (10, 20), (20, 30), (30, 40), (40, 60)]
    print(tamper.__name__, f"at its end {np.sqrt(np.mean(found[:, int(END) - 2] ** 2)):.1f} m;",
          " ".join(
              f"+{a}: {np.sqrt(np.mean(found[:, int(END) + a : int(END) + b] ** 2)):.1f}"
              for a, b in spans
          ), f"usual {usual:.1f} m")
    back = np.sqrt(np.mean(found[:, from_row : from_row + 60] ** 2))
    assert back < 1.5 * usual
    last = np.sqrt(np.mean(found[:, -60:] ** 2, axis=1))
    assert last.max() < 15.0



@pytest.mark.slow
@pytest.mark.parametrize("sampling_time", [1.0, 0.1])
@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, 180.0, 270.0])
def test_a_start_20_m_wrong_is_forgotten(sampling_time: float, bearing_deg: float) -> None:
    """Believed to 1 m, with 10 % of the ranges late by 3 m on the average."""
    scenario = sblcosim.load("paper-scenario-1", {
        "time.sampling_time_s": sampling_time, "acoustics.outlier_probability": 0.1,
        "acoustics.outlier_mean_m": 3.0,
    })
    plan = resolve(connect(scenario, "coupled"))
    seeds = np.arange(1, RUNS + 1)
    start = execute(plan, {}, record=["target.position"]).values["target.position"][0, 0]
    bearing = np.radians(bearing_deg)
    errors = []
    for off in (0.0, 20.0):
        prior = start + off * np.array([np.cos(bearing), np.sin(bearing), 0.0])
        outcome = execute(
            plan,
            {**{f"{name}.seed": seeds for name in ("target", "platform", "acoustics")},
             "coupled.prior_position": prior[None, :], "coupled.acceleration_psd": [0.003]},
            record=["coupled.position", "target.position"],
        )
        off_by = outcome.values["coupled.position"] - outcome.values["target.position"]
        errors.append(np.linalg.norm(off_by, axis=2))
    time = (outcome.time_ns - outcome.time_ns[0]) / 1e9
    usual, found = errors

    def rms(of: Floats, begin: float, end: float) -> float:
        return float(np.sqrt(np.mean(of[:, (begin <= time) & (time < end)] ** 2)))

    print(sampling_time, bearing_deg, " ".join(
        f"+{t}: {rms(found, t, t + 10):.2f} ({rms(usual, t, t + 10):.2f})" for t in range(5, 85, 10)
    ))
    assert rms(found, 60.0, 90.0) < 1.5 * rms(usual, 60.0, 90.0)
