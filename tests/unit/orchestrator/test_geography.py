"""Paths of a run on Earth: every point at its own place and time, in both files."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import geojson
import gpxpy
import numpy as np
import pandas as pd
import pytest
from sblcosim.results import geography
from sblcosim.tracks.place import Origin
from seams import Seam

ORIGIN = Origin(60.1, -5.2, 47.0)
EARTH_M = 6_371_000.0
Point = tuple[float, float, float, float]
"""Time [s], north, east and down [m]."""


def a_run(position: Any, epochs: Any, estimated: Any) -> tuple[Any, dict[str, pd.DataFrame]]:
    """A record of the truth each half a second, and the estimates of a receiver."""
    position = np.asarray(position, float)
    record = SimpleNamespace(
        time_ns=np.arange(len(position), dtype=np.int64) * 500_000_000,
        values={"target.position": position},
    )
    table = pd.DataFrame(np.asarray(estimated, float).reshape(-1, 3), columns=["x_m", "y_m", "z_m"])
    return record, {"ekf": table.assign(epoch_s=np.asarray(epochs, float))}


def written(folder: Path, record: Any, estimates: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Features of path.geojson and points of path.gpx, by name."""
    geography.write(folder, "a dive", ORIGIN, record, estimates)
    text = (folder / "path.geojson").read_text("utf-8")
    features = {f["properties"]["name"]: f for f in json.loads(text)["features"]}
    document = gpxpy.parse((folder / "path.gpx").read_text("utf-8"))
    return features, {t.name: t.segments[0].points for t in document.tracks}


def local(latitude: float, longitude: float) -> tuple[float, float]:
    """North and east [m] on a sphere, good to half a per cent: another way than the project's."""
    north = np.radians(latitude - ORIGIN.latitude_deg) * EARTH_M
    east = np.radians(longitude - ORIGIN.longitude_deg) * EARTH_M
    return north, east * np.cos(np.radians(ORIGIN.latitude_deg))


def test_points_are_where_and_when_they_were(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    truth = np.column_stack([rng.uniform(-500, 500, (9, 2)), rng.uniform(1, 40, 9)])
    epochs = np.sort(rng.uniform(0.0, 4.0, 5))  # between the instants of the record
    estimated = np.column_stack([rng.uniform(-500, 500, (5, 2)), rng.uniform(1, 40, 5)])
    features, tracks = written(tmp_path, *a_run(truth, epochs, estimated))
    assert geojson.loads((tmp_path / "path.geojson").read_text("utf-8")).is_valid
    for name, when, expected in (
        ("truth", np.arange(9) / 2.0, truth), ("ekf", epochs, estimated),
    ):  # fmt: skip
        line, points = features[name], tracks[name]
        np.testing.assert_allclose(line["properties"]["time_s"], when, rtol=0, atol=1e-12)
        start = datetime(1970, 1, 1, tzinfo=UTC)
        seconds = [(p.time - start).total_seconds() for p in points if p.time is not None]
        np.testing.assert_allclose(seconds, when, rtol=0, atol=2e-6)
        assert line["geometry"]["type"] == "LineString"
        for (longitude, latitude, height), point, (north, east, down) in zip(
            line["geometry"]["coordinates"], points, expected, strict=True
        ):
            assert local(latitude, longitude) == pytest.approx((north, east), rel=6e-3, abs=0.05)
            assert height == pytest.approx(ORIGIN.height_m - down, abs=0.1)  # above the ellipsoid
            assert (point.latitude, point.longitude) == pytest.approx((latitude, longitude))
            assert point.elevation == pytest.approx(-down, abs=0.1)  # above the water


def test_what_is_not_known_is_left_out_with_its_time(tmp_path: Path) -> None:
    estimated = [[1.0, 2.0, 3.0], [np.nan, 2.0, 3.0], [5.0, 6.0, 7.0]]
    features, tracks = written(tmp_path, *a_run(np.zeros((3, 3)), [0.1, 0.2, 0.3], estimated))
    assert features["ekf"]["properties"]["time_s"] == [0.1, 0.3]
    assert len(features["ekf"]["geometry"]["coordinates"]) == len(tracks["ekf"]) == 2


def test_one_estimate_is_a_point_and_none_is_nothing(tmp_path: Path) -> None:
    for count, kind in ((1, "Point"), (0, None)):
        features, tracks = written(
            tmp_path, *a_run(np.zeros((3, 3)), [0.1] * count, np.ones((count, 3)))
        )
        geometry = features["ekf"]["geometry"]
        assert (geometry and geometry["type"]) == kind
        assert len(tracks["ekf"]) == count


def test_a_long_path_keeps_the_times_of_the_points_that_are_left(
    tmp_path: Path, seam: Seam
) -> None:
    seam.tuned(geography_points=4)
    truth = np.column_stack([np.arange(10.0), np.zeros(10), np.zeros(10)])
    features, tracks = written(tmp_path, *a_run(truth, [], np.zeros((0, 3))))
    times = features["truth"]["properties"]["time_s"]
    assert times == [0.0, 1.5, 3.0, 4.5]  # every third of half a second
    north = [local(p.latitude, p.longitude)[0] for p in tracks["truth"]]
    assert north == pytest.approx([0.0, 3.0, 6.0, 9.0], abs=0.05)
