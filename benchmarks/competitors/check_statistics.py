"""Whether sblcosim and its competitors simulate the same thing.

At a few points of the paper's study in Scenario 1, preset ``paper-literal``: the mean over runs of
each run's RMS error, with its standard error, from sblcosim, both NumPy scripts and the Octave
script. All draw their own random numbers. The exit status is 1 if a competitor's mean differs from
ours by more than three standard errors of the difference. Seeds are fixed, and so is the outcome.

Run by hand: ``python benchmarks/competitors/check_statistics.py``
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy_plain
import numpy_study
import sblcosim
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AXES = ("x", "y", "z", "total")
LIMIT = 3.0
"""Limit in standard errors of the difference."""

LOW = {name: levels[0] for name, levels in numpy_study.FACTORS.items()} | {"sampling_time": 0.1}
HIGH = {name: levels[1] for name, levels in numpy_study.FACTORS.items()} | {"sampling_time": 1.0}
POINTS = {
    "all low": LOW,
    "GPS 3.5 m": LOW | {"gps_std": 3.5},
    "baseline 0.4 m": LOW | {"baseline": 0.4},
    "T 1 s, loss 25 %": LOW | {"sampling_time": 1.0, "loss_probability": 0.25},
    "all high": HIGH,
}


@dataclass(frozen=True)
class Sample:
    """Mean over runs of the RMS error in x, y, z and total in m, and its standard error; (4,)."""

    mean: Floats
    error: Floats

    @classmethod
    def of(cls, rms: Floats) -> Sample:
        """Mean and standard error from RMS errors, (4, runs)."""
        return cls(rms.mean(axis=1), rms.std(axis=1, ddof=1) / np.sqrt(rms.shape[1]))


def ours(point: Mapping[str, float], runs: int) -> Floats:
    """RMS errors in m from sblcosim, (4, runs), seeds 1, 2, ..."""
    imu_std_deg = float(np.degrees(point["imu_std"]))
    overrides = {
        "time.sampling_time_s": point["sampling_time"],
        "target.depth_std_m": point["depth_std"],
        "platform.arm_length_m": point["baseline"],
        "platform.gps_horizontal_std_m": point["gps_std"],
        "platform.imu_tilt_std_deg": imu_std_deg,
        "platform.imu_heading_std_deg": imu_std_deg,
        "acoustics.range_std_m": point["range_std"],
        "acoustics.loss_probability": point["loss_probability"],
    }
    rows = []
    for seed in range(1, runs + 1):
        result = sblcosim.run("paper-scenario-1", "ekf", overrides | {"seed": seed})
        rows.append([result.errors.loc[("ekf", "absolute", axis), "rms_m"] for axis in AXES])
    return np.array(rows, dtype=float).T


def numpy_runs(
    point: Mapping[str, float], runs: int, simulate: numpy_study.Simulate, seed: int = 1
) -> Floats:
    """RMS errors in m from one of the NumPy scripts, (4, runs)."""
    factors = {name: np.full(runs, point[name]) for name in numpy_study.FACTORS}
    return numpy_study.study(point["sampling_time"], factors, seed, simulate=simulate)


def octave_runs(point: Mapping[str, float], runs: int, seed: int = 1) -> tuple[Floats, float, str]:
    """RMS errors in m from the Octave script, (4, runs); smallest time per step in µs; version.

    Raises
    ------
    FileNotFoundError
        Octave is not installed.
    subprocess.CalledProcessError
        The script has failed.
    """
    program = shutil.which("octave-cli")
    if program is None:
        raise FileNotFoundError("octave-cli: must be installed, for instance by apt-get install")
    options = {k: v for k, v in point.items() if k != "imu_std"}
    options |= {"imu_std_deg": float(np.degrees(point["imu_std"])), "runs": runs, "seed": seed}
    script = Path(__file__).with_name("octave_study.m")
    done = subprocess.run(
        [program, "--norc", "--no-history", str(script)]
        + [text for name, value in options.items() for text in (f"--{name}", repr(value))],
        check=True,
        capture_output=True,
        text=True,
    )
    answer = json.loads(done.stdout)
    rms = np.atleast_2d(np.array(answer["rms"], dtype=float)).T
    return rms, float(answer["us_per_step"]), answer["version"]


def main() -> int:
    """Print the table; returns 1 if something differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=40, help="runs of sblcosim at each point")
    parser.add_argument("--numpy-runs", type=int, default=400)
    parser.add_argument("--octave-runs", type=int, default=20)
    arguments = parser.parse_args()

    print(
        f"Mean RMS error [m] ± its standard error; {arguments.runs} runs of sblcosim, "
        f"{arguments.numpy_runs} of each NumPy script, {arguments.octave_runs} of Octave.\n"
        f"d: difference from sblcosim in standard errors of the difference, at most {LIMIT:g}.\n"
    )
    heads = "".join(f"{name:>19}{'d':>7}" for name in ("NumPy, tuned", "NumPy, plain", "Octave"))
    print(f"{'point':18}{'axis':7}{'sblcosim':>17}{heads}")
    worst = 0.0
    for name, point in POINTS.items():
        reference = Sample.of(ours(point, arguments.runs))
        others = [
            Sample.of(numpy_runs(point, arguments.numpy_runs, numpy_study.simulate)),
            Sample.of(numpy_runs(point, arguments.numpy_runs, numpy_plain.simulate, seed=2)),
            Sample.of(octave_runs(point, arguments.octave_runs)[0]),
        ]
        differences = [
            (other.mean - reference.mean) / np.hypot(other.error, reference.error)
            for other in others
        ]
        # not max(): a NaN must not pass
        worst = float(np.max([worst, *np.abs(differences).ravel()]))
        for i, axis in enumerate(AXES):
            cells = "".join(
                f"{other.mean[i]:11.4f} ±{other.error[i]:6.4f}{difference[i]:7.2f}"
                for other, difference in zip(others, differences, strict=True)
            )
            print(
                f"{name if i == 0 else '':18}{axis:7}"
                f"{reference.mean[i]:9.4f} ±{reference.error[i]:6.4f}{cells}"
            )
    agree = worst <= LIMIT
    print(f"\nlargest difference: {worst:.2f} standard errors: {'agree' if agree else 'DIFFER'}")
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
