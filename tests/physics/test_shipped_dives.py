"""The page of the two dives by physics: its numbers are those of the files, and of 200 runs."""

from __future__ import annotations

import re
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest
import sblcosim
from sblcosim.scenario.scenario import shipped_text

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "dives.md").read_text(encoding="utf-8")
RUNS = 200
DIVES = ("realistic-sea", "harbour-wakes")
UNSAID = {
    "time.ekf_ratio", "time.duration_s", "target.trajectory", "target.center_m",
    "target.depth_end_m", "platform.motion", "platform.random_phases", "platform.beacon_depth_m",
    "platform.gps_horizontal_std_m", "platform.yaw_frequency_Hz",
}
"""Choices, and keys that go with another one."""


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def rows(heading: str, first: str) -> dict[str, list[str]]:
    """Cells of the rows of a table after a heading, by the first cell."""
    text = PAGE.partition(heading)[2].partition(first)[2].partition("\n\n")[0]
    return {cells(line)[0]: cells(line)[1:] for line in text.splitlines() if line.startswith("| `")}


@pytest.mark.parametrize("name", DIVES)
def test_the_page_has_each_number_with_its_source(name: str) -> None:
    given = tomllib.loads(shipped_text(name))
    listed: dict[str, str] = {}
    for keys, (value, why) in rows(f"## Numbers of `{name}`", "|---|").items():
        assert why
        for key in re.findall(r"`([\w.]+)`", keys):
            listed[key] = value
    for key, value in listed.items():
        table, _, own = key.partition(".")
        assert own in given[table], key
        if "," not in value and " " not in value:
            assert value == str(given[table][own]), key
    said = {f"{table}.{key}" for table in ("time", "target", "platform", "acoustics")
            for key in given.get(table, {})}
    assert said - {*listed} <= UNSAID


def many(name: str, receiver: str = "coupled", overrides: Any = (), runs: int = RUNS) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sblcosim.run_many(name, receiver, dict(overrides), runs=runs)


@pytest.mark.parametrize("name", [
    *DIVES, *(pytest.param(it, marks=pytest.mark.slow)
              for it in ("realistic-dive", "harbour-square"))
])
def test_the_page_has_the_errors_of_200_runs(name: str) -> None:
    rms, median, worst, within, nees, lost = rows("## What `coupled` does", "|---|")[f"`{name}`"]
    found = many(name)
    each = found.tables["runs"]["coupled.absolute_total_rms_m"]
    assert found.answer.startswith(
        f"coupled: {rms} m RMS, 95 % within {within} m, lost in {lost} of {RUNS} runs, misleading "
        "in 0 "
    )
    assert f"{each.median():.3g}" == median
    assert f"{each.max():.3g}" == f"{float(worst):.3g}"
    assert f"{found.tables['runs']['coupled.nees_position'].mean():.2f}" == nees


NONE = {"acoustics.surface_echo_probability": 0.0, "acoustics.bottom_echo_probability": 0.0}
PARTS: tuple[tuple[str, dict[str, float]], ...] = (
    ("coupled", {}), ("coupled", NONE), ("coupled", {"acoustics.loss_burst_length": 0.0}),
    ("coupled", {"receiver.outlier_mean_m": 1.0}), ("ekf", {}), ("fixed_lag", {}),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", DIVES)
def test_the_page_has_what_single_parts_cost(name: str) -> None:
    line = next(line for line in PAGE.partition("What single parts cost")[2].splitlines()
                if line.startswith(f"| `{name}`"))
    for cell, (receiver, overrides) in zip(cells(line)[1:], PARTS, strict=True):
        rms = re.search(r": ([\d.]+) m RMS", many(name, receiver, overrides).answer)
        assert rms is not None
        assert rms[1] == cell, (receiver, overrides)
    lost = many("harbour-wakes", "fixed_lag").answer
    assert f"lost in {re.findall(r'`fixed_lag` is lost in (.*) of 200 runs', PAGE)[0]} of" in lost


@pytest.mark.slow
def test_the_mean_excess_of_echoes_matters_where_they_are_long() -> None:
    """The figures of models/receiver/README.md: echoes that are 12 m late in 4.5 % of ranges."""
    keys = {"acoustics.bottom_echo_probability": 0.1414, "acoustics.water_depth_m": 15.0,
            "acoustics.outlier_probability": 0.0}
    known = sblcosim.load("realistic-dive", keys).receiver
    assert known.outlier_mean_m == pytest.approx(12.0, abs=0.2)
    assert known.outlier_probability == pytest.approx(0.045, abs=1e-3)
    for more, rms, lost in (({"receiver.outlier_mean_m": 1.0}, 4.8, 37), ({}, 2.9, 1)):
        runs = many("realistic-dive", overrides={**keys, **more}, runs=2000)
        found = re.match(r"coupled: ([\d.]+) m RMS.*lost in (\d+) of", runs.answer)
        assert found is not None
        assert (round(float(found[1]), 1), int(found[2])) == (rms, lost)
