"""Identify the device of a log or of a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from sblcosim.fmus.stopping import interruptible
from sblcosim.models.settings.assumptions import has_clock

from ..data.estimates import Floats
from ..data.samples import OWN, Samples, of_record
from ..errors import ConfigurationError
from ..estimation.after import LONG_BASELINE, assumed, prepared
from ..estimation.folder import RECORD, read_run
from ..estimation.model import parameters
from ..logs.columns import OF_RANGING
from ..logs.log import Log
from ..logs.read import read_log
from ..processing.settings import Given, Settled, settled
from ..results.result import Result
from ..scenario.arrangement import has_own_errors
from ..scenario.scenario import Scenario
from ..words.lists import counted
from ..words.shares import percent
from .device import Assumed, device_of
from .dive import dive_of
from .result import Identified
from .swings import swings_of

_LEAST_WALK = 1e-6
"""Random walk of a clock's error that is always possible [m²/s]."""
LogInput = tuple[Samples, Floats | None, Assumed, Scenario]
"""Samples; positions of the beacons on a platform; what is known of the device; a scenario."""


@interruptible
def identify(
    log: str | Path | Log | Result, *, scenario: Given = None, mapping: str | Path | None = None
) -> Identified:
    """What a log tells about its device: noise, late ranges, offsets, scale, losses and motion.

    No truth is used, even if the log has one. Ranges that are far too short or far too late
    are left out, as by `sblcosim.process`, and count as lost.

    Parameters
    ----------
    log
        The folder or file of a log, a log from `sblcosim.read_log`, or a run or its folder.
    scenario
        A scenario whose other keys are kept: what is known of the device. None: that of the log, or
        usual values.
    mapping
        File that says which column of the log is what; see `sblcosim.read_log`.

    Raises
    ------
    ConfigurationError
        The log cannot be read, or has too few ranges.

    Examples
    --------
    >>> found = sblcosim.identify("dive/")                              # doctest: +SKIP
    >>> sblcosim.process("dive/", scenario=found.scenario())           # doctest: +SKIP
    """
    if isinstance(log, Result) or (not isinstance(log, Log) and (Path(log) / RECORD).is_file()):
        samples, body, known, base = of_run(log)
        _check_clock(base)
        name = base.name if isinstance(log, Result) else Path(log).resolve().name
        return Identified(name, device_of(samples, body, known), base)
    heard = log if isinstance(log, Log) else read_log(log, mapping)
    ready = settled(heard, scenario)
    _check_clock(ready.scenario)
    samples, body, known, base = of_log(ready)
    device = device_of(samples, body, known)
    base = _ranging(ready.log, base, scenario is not None)
    dive, of_dive = ({}, []) if scenario is not None or ready.log.scenario is not None else (
        dive_of(ready.log, device, base)
    )
    lost = len(heard.receptions) - len(ready.log.receptions)
    counts = [f"losses: {counted(lost, 'range')} left out, as if lost"] if lost else []
    log_says = (*ready.log.counted(), *counts, *ready.log.without_depth())
    said = (*log_says, ready.said, *of_dive, *_named(ready.log))
    return Identified(ready.log.name, device, base, said, ready.log.beacons, dive)


def _check_clock(scenario: Scenario) -> None:
    """Refuse differences of arrivals: without a path, they tell nothing of the device."""
    if not has_clock(scenario.acoustics):
        raise ConfigurationError(
            "log: must have ranges to tell its device, got differences of arrivals: "
            f"{scenario.where('acoustics', 'common_clock')} is false"
        )


def _ranging(log: Log, base: Scenario, given: bool) -> Scenario:
    """The scenario with the way to range that the log tells.

    Raises
    ------
    ConfigurationError
        The log has ranges of several kinds, and no scenario says what the device does.
    """
    kinds = {ranging: log.kinds.get(kind, 0.0) for ranging, kind in OF_RANGING.items()}
    others = {ranging: share for ranging, share in kinds.items() if share and ranging != "one_way"}
    if log.scenario is not None or not others:
        return base
    (ranging, share), *more = others.items()
    if (share < 1 or more) and not given:
        raise ConfigurationError(
            f"log: must have ranges of one kind, or come with a scenario that has the ranging of "
            f"the device, got {percent(share)} {OF_RANGING[ranging]} ranges in {log.name}"
        )
    return base.override({"acoustics.ranging": ranging}.items()) if share == 1 else base


def _named(log: Log) -> list[str]:
    """Which beacon has which number in the table, if their names do not say so."""
    names = [f"{i} is {name}" for i, name in enumerate(log.beacons, 1) if name != str(i)]
    return [f"numbers of the beacons: {', '.join(names)}"] if names else []


def of_run(log: Result | str | Path) -> LogInput:
    """What is needed of a run, or of its folder.

    Raises
    ------
    ConfigurationError
        The folder does not hold a run of a scenario.
    """
    result = log if isinstance(log, Result) else read_run(log)
    described = result.scenario
    if not isinstance(described, Scenario):
        raise ConfigurationError("log: must be the run of a scenario, got that of a package")
    if not has_own_errors(described.platform):
        _, p, samples, _ = prepared(result)
        return samples, np.asarray(p.beacon_offset, float), _on_platform(p, described), described
    samples = of_record(result.record, np.zeros((described.beacons, 3)), OWN)
    return samples, None, _in_field(described), described


def of_log(ready: Settled) -> LogInput:
    """What is needed of a log with its settings."""
    log, scenario = ready.log, ready.scenario
    on_platform = ready.arrangement == "platform" and bool(log.receptions.has_pose.any())
    samples = log.samples(None if on_platform else OWN)
    samples = replace(samples, position=samples.position - ready.origin)
    if not on_platform:
        return samples, None, _in_field(scenario), scenario
    p = parameters(assumed(scenario, ()), np.zeros(3))
    return samples, np.asarray(p.beacon_offset, float), _on_platform(p, scenario), scenario


def _on_platform(p: Any, scenario: Scenario) -> Assumed:
    """What is known of a device whose beacons are on a platform."""
    body = np.asarray(p.beacon_offset, float)
    # An angle of the IMU moves a beacon across its arm: in the heading, along one of two axes.
    arm = float(np.sqrt(np.mean(np.sum(body[:, :2] ** 2, axis=1))))
    antenna = np.asarray(scenario.platform.gps_antenna_offset_m, float)
    return Assumed(
        float(p.assumed_sound_speed), depth_bias_std=float(p.depth_bias_std),
        place_noise_std=arm * float(p.imu_heading_std) / np.sqrt(2),
        place_down_noise_std=arm * float(p.imu_tilt_std) / np.sqrt(2),
        clock_walk_psd=max(float(p.clock_walk_psd), _LEAST_WALK),
        swings=swings_of(scenario.platform, float(np.hypot(*antenna[:2]))),
    )


def _in_field(scenario: Scenario) -> Assumed:
    """What is known of a device whose beacons have errors of their own."""
    receiver = assumed(scenario, (), LONG_BASELINE).receiver
    places = np.reshape(scenario.platform.beacon_m, (-1, 3))
    arm = float(np.hypot(places[:, 0], places[:, 1]).max())
    return Assumed(
        scenario.acoustics.assumed_sound_speed_m_s, receiver.beacon_error_std_m,
        receiver.beacon_vertical_error_std_m, depth_bias_std=receiver.depth_bias_std_m,
        clock_walk_psd=receiver.clock_walk_psd_m2_s,
        swings=swings_of(scenario.platform, arm),
    )
