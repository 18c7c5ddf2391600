"""The campaigns of `sblcosim paper`: its studies, points and sessions, and their folders.

They are the paper's three factorial studies, the same ranges as spaces, the favourable point of
each scenario, and the sessions of its Table 2. Each campaign is a study with a folder of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
from sblcosim.fmus.files import is_hidden

from ... import artifacts
from ...api import run as run_scenario
from ...data.record import Record
from ...errors import ConfigurationError, resolved
from ...results.figures.run import INCLINATION_WINDOW_S
from ...scenario.scenario import load as load_scenario
from ...study import parts, runner, store
from ...study import study as studies
from ...study.study import Study
from ...words.shares import percent
from .ranges import spaces

Progress = Callable[[float, str], None]
"""Function of the finished share and of a word for the current task."""
SCENARIOS = (1, 2, 3)
SEAS = (2, 4)
"""Beaufort numbers of Figure 9."""
SESSIONS = ("square", "spiral", "random")
RUNS, PAGES = "runs", "report"
"""Folders within the folder of the command."""
REPLICATES, QUICK_REPLICATES = 50, 5
SESSION_RUNS, QUICK_SESSION_RUNS = 500, 100
POINT_RUNS = 50

FAVOURABLE: dict[str, dict[str, float]] = {
    "time": {"sampling_time_s": 0.1},
    "target": {"speed_m_s": 0.3, "depth_std_m": 0.1},
    "platform": {
        "arm_length_m": 3.0, "gps_horizontal_std_m": 0.1,
        "imu_tilt_std_deg": 10.0, "imu_heading_std_deg": 10.0,
    },
    "acoustics": {"range_std_m": 0.1, "loss_probability": 0.0},
    "receiver": {"acceleration_psd_m2_s3": 0.1},
}
"""The design point that fits the paper's Table 4, and the other changes to the preset."""


@cache
def all_campaigns(quick: bool = False) -> dict[str, Study]:
    """The campaigns, by the names of their folders."""
    replicates = QUICK_REPLICATES if quick else REPLICATES
    all_studies = {
        f"paper-scenario-{n}": studies.load(f"paper-scenario-{n}").with_replicates(replicates)
        for n in SCENARIOS
    }
    for n in SCENARIOS:
        all_studies[f"favourable-{n}"] = studies.load({
            "name": f"favourable-{n}", "title": f"Favourable point of Scenario {n}",
            "scenario": f"paper-scenario-{n}", "fixed": FAVOURABLE, "design": {"kind": "single"},
            "replicates": POINT_RUNS, "seed": 30001 + 1000 * n,
        })
    for i, name in enumerate(SESSIONS):
        all_studies[f"harbour-{name}"] = studies.load({
            "name": f"harbour-{name}", "title": f"Sessions of Table 2: {name}",
            "scenario": f"harbour-{name}", "receivers": ["ekf", "multilateration"],
            "design": {"kind": "single"}, "seed": 40001 + 1000 * i,
            "replicates": QUICK_SESSION_RUNS if quick else SESSION_RUNS,
        })
    return all_studies | spaces(quick, SCENARIOS)


def favourable_in_words() -> str:
    """The favourable point in words, and the preset's values."""
    point = load_scenario("paper-scenario-1", FAVOURABLE.items())
    preset = load_scenario("paper-scenario-1")
    return (
        f"{_sensors(point)}; speed {point.target.speed_m_s:g} m/s and process noise "
        f"{point.receiver.acceleration_psd_m2_s3:g} m²/s³, where the preset has "
        f"{preset.target.speed_m_s:g} and {preset.receiver.acceleration_psd_m2_s3:g}"
    )


def sessions_in_words() -> str:
    """The settings of the sessions in the harbour, in words."""
    session = load_scenario("harbour-square")
    platform, target = session.platform, session.target
    return (
        f"slow GPS error (Gauss–Markov, {platform.gps_horizontal_markov_std_m:g} m "
        f"per horizontal axis, {platform.gps_correlation_time_s:g} s), {_sensors(session)}, wave "
        f"angles of {platform.roll_amplitude_deg:g}°, variances in R, process noise "
        f"{session.receiver.acceleration_psd_m2_s3:g} m²/s³, speed {target.speed_m_s:g} m/s, "
        f"depth {target.depth_start_m:g} m"
    )


def _sensors(scenario: Any) -> str:
    platform, acoustics = scenario.platform, scenario.acoustics
    return (
        f"white GPS error {platform.gps_horizontal_std_m:g} m, baseline "
        f"{platform.arm_length_m:g} m, sampling time {scenario.time.sampling_time_s:g} s, range "
        f"{acoustics.range_std_m:g} m, packet loss {percent(acoustics.loss_probability, '.0f')}, "
        f"IMU {platform.imu_tilt_std_deg:g}°, depth {scenario.target.depth_std_m:g} m"
    )


def check(folder: Path) -> None:
    """Refuse a folder that holds something else or cannot be written to.

    Raises
    ------
    ConfigurationError
        The folder is such a folder.
    """
    if folder.is_dir():
        foreign = sorted(
            f.name
            for f in folder.iterdir()
            if f.name not in (RUNS, PAGES) and not is_hidden(f.name)
        )
        if foreign:
            raise ConfigurationError(
                f"{folder}: must be empty or hold what 'sblcosim paper' wrote, got {foreign[0]!r} "
                "in it"
            )
    elif os.path.lexists(folder):
        raise ConfigurationError(f"{folder}: must be a folder or not exist yet, got a file")
    for name in all_campaigns():
        results = folder / RUNS / name
        if results.is_dir() and not (results / store.STUDY).exists():
            for file in sorted(results.iterdir()):
                if file.name in (parts.PARTS, parts.RUNS) or is_hidden(file.name):
                    continue
                raise ConfigurationError(
                    f"{results}: must be empty or hold results of this study, got {file.name!r} "
                    "in it"
                )
    artifacts.check(folder / PAGES)


def runs_of(study: Study) -> int:
    """The number of runs of a study."""
    return len(study.points.values) * study.replicates


def progress_of(out: str | Path, quick: bool = False) -> tuple[int, int]:
    """The number of finished runs, and of all runs."""
    folder = resolved(out) / RUNS
    runs = {name: runs_of(study) for name, study in all_campaigns(quick).items()}
    done = sum(min(len(store.finished(folder / name)), number) for name, number in runs.items())
    return done, sum(runs.values())


def simulate(
    folder: Path, studies: Mapping[str, Study], workers: int | None, tell: Progress
) -> dict[str, pd.DataFrame]:
    """Do the missing runs of all campaigns; returns the tables by the names of the campaigns."""
    total = sum(map(runs_of, studies.values()))
    tables, passed = {}, 0
    for name, study in studies.items():
        own = runs_of(study)

        def report(share: float, passed: int = passed, own: int = own) -> None:
            tell(0.5 * (passed + share * own) / total, "simulating")

        tables[name] = runner.run(study, folder / name, workers=workers, progress=report)
        passed += own
    return tables


def sea(beaufort: int) -> Record:
    """The platform in a sea with a Beaufort number."""
    changes = {"platform.beaufort": beaufort, "time.duration_s": INCLINATION_WINDOW_S}
    return run_scenario("harbour-square", overrides=changes.items()).record
