"""Runs of many shapes, made by hand: what figures of a run have to be laid out for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.data.record import Record
from synthetic_record import track

Floats = NDArray[np.float64]
ROWS = 301
ARMS = np.array([[3.0, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]])
BUOYS = np.array([[60.0, 40, 1], [-60, 40, 1], [-60, -40, 1], [60, -40, 1]])


@dataclass(frozen=True)
class Shape:
    """A run: the ends or the course of its path, its duration, its beacons and its receivers.

    `course` maps times from 0 to 1 to north, east and depth [m], shape (n, 3).
    """

    course: Callable[[Floats], Floats]
    duration_s: float = 190.0
    beacons: Floats | None = None
    receivers: tuple[str, ...] = ("ekf", "raw")
    noise_m: float = 0.5
    raw_noise_m: float = 1.5
    reported_off_m: tuple[float, float, float] = (0.4, -0.3, 0.0)
    start_s: float = 0.0


def line(*ends: tuple[float, float, float]) -> Callable[[Floats], Floats]:
    """A path through points, at times that are equally far apart."""
    points = np.array(ends, float)
    at = np.linspace(0, 1, len(points))
    return lambda t: np.column_stack([np.interp(t, at, column) for column in points.T])


def circle(radius: float, turns: float = 1.0, depth: float = 5.0, away: float = 0.0,
           deeper: float = 0.0) -> Callable[[Floats], Floats]:
    """Turns about a point that is `away` to the east."""
    def course(t: Floats) -> Floats:
        angle = 2 * np.pi * turns * t
        return np.column_stack([radius * np.sin(angle), away + radius * np.cos(angle),
                                depth + deeper * t])  # fmt: skip
    return course


def spiral(radius: float, turns: float) -> Callable[[Floats], Floats]:
    """A spiral outwards."""
    def course(t: Floats) -> Floats:
        angle = 2 * np.pi * turns * t
        return np.column_stack([radius * t * np.sin(angle), radius * t * np.cos(angle), 2 + 8 * t])
    return course


def lawn(length: float, width: float, legs: int) -> Callable[[Floats], Floats]:
    """Parallel legs to the north and back."""
    ends = []
    for leg in range(legs):
        east = width * leg / (legs - 1)
        norths = (0.0, length) if leg % 2 == 0 else (length, 0.0)
        ends += [(north, east, 8.0) for north in norths]
    return line(*ends)


MANY = ("ekf", "sequential", "coupled", "LastBeacon", "raw")
LONG = ("a_receiver_of_a_student_with_a_very_long_name_v1", "coupled", "raw")
SHAPES: dict[str, Shape] = {
    "straight_east_95_m": Shape(line((-5, -45, 5), (-5, 50, 5))),
    "straight_north_95_m": Shape(line((-45, 10, 5), (50, 10, 5))),
    "straight_north_raw_wide": Shape(line((-45, 10, 5), (50, 10, 5)), raw_noise_m=12.0),
    "straight_east_raw_wide": Shape(line((10, -45, 5), (10, 50, 5)), raw_noise_m=12.0),
    "diagonal_95_m": Shape(line((-30, -30, 5), (37, 37, 15))),
    "north_2_km": Shape(line((0, 20, 10), (2000, 20, 10)), 3600.0, noise_m=8, raw_noise_m=60),
    "east_2_km_far": Shape(line((1000, 0, 10), (1000, 2000, 40)), 3600.0, noise_m=9),
    "box_2_m": Shape(line((4, 4, 3), (6, 4, 3), (6, 6, 3), (4, 6, 3), (4, 4, 3)), 20.0,
                     noise_m=0.05, raw_noise_m=0.2),
    "line_2_m": Shape(line((4, 4, 3), (6, 4, 3)), 4.0, noise_m=0.05, raw_noise_m=0.2),
    "three_seconds": Shape(line((10, 0, 3), (11.5, 0, 3)), 3.0),
    "ten_hours": Shape(lawn(400, 200, 9), 36000.0, noise_m=2),
    "rest": Shape(line((8, 6, 10), (8, 6, 10)), 600.0),
    "rest_below": Shape(line((0, 0, 10), (0, 0, 10)), 600.0, receivers=("ekf",),
                        reported_off_m=(0, 0, 0)),
    "vertical": Shape(line((2, 1, 0), (2, 1, 60)), 300.0),
    "deep_wide": Shape(line((0, 0, 0), (100, 10, 90), (200, 20, 5)), 1800.0),
    "circle": Shape(circle(15.0)),
    "circle_ten_turns": Shape(circle(30.0, 10.0, deeper=20.0), 2400.0),
    "circle_far_away": Shape(circle(20.0, away=800.0), noise_m=5.0, raw_noise_m=40.0),
    "spiral": Shape(spiral(30.0, 4.0), 500.0, receivers=MANY),
    "lawn_narrow": Shape(lawn(100, 12, 5), 1200.0),
    "lawn_wide_many": Shape(lawn(20, 160, 9), 1200.0, receivers=MANY),
    "straight_many": Shape(line((-45, 10, 5), (50, 10, 5)), receivers=MANY),
    "straight_east_many": Shape(line((5, -45, 5), (5, 50, 5)), receivers=MANY),
    "long_names": Shape(line((-45, 10, 5), (50, 10, 5)), receivers=LONG, raw_noise_m=30.0),
    "long_names_wide": Shape(line((0, -45, 5), (0, 50, 5)), receivers=LONG, raw_noise_m=30.0),
    "there_and_back": Shape(line((0, 3, 5), (80, 3, 5), (0, 3, 5)), 320.0),
    "buoys": Shape(lawn(60, 60, 4), 900.0, beacons=BUOYS),
    "buoys_in_a_row": Shape(
        line((0, -100, 12), (0, 100, 12)), 400.0, beacons=BUOYS * np.array([0.02, 2.0, 1.0]),
    ),
    "far_coordinates": Shape(line((5200, -81000, 5), (5295, -81000, 5)),
                             beacons=ARMS + np.array([5200.0, -81000.0, 0.0])),
    "late_start": Shape(line((-45, 10, 5), (50, 12, 25)), 95.0, start_s=86000.0),
    "tiny_wiggle": Shape(circle(0.3, 3.0, away=5.0), 12.0, noise_m=0.02, raw_noise_m=0.1),
    "deep": Shape(line((2, 1, 1), (3, 2, 300)), 300.0, noise_m=4.0, raw_noise_m=12.0),
    "moves_for_a_while": Shape(
        line(*[(0, 5, 4)] * 3, (30, 20, 4), (-10, 40, 4), *[(20, 60, 4)] * 20), 7200.0, noise_m=2.0,
    ),
    "stops_on_its_way": Shape(
        line((0, 5, 4), (20, 25, 4), *[(40, 45, 4)] * 5, (60, 65, 4), (80, 85, 4)), 480.0,
    ),
    "runs_away": Shape(line((-45, 10, 5), (50, 10, 5)), noise_m=2e8),
    "lost": Shape(line((-45, 10, 5), (50, 10, 5)), noise_m=400.0, raw_noise_m=3000.0),
}  # fmt: skip
"""By name."""


def run_of(shape: Shape) -> tuple[Record, dict[str, pd.DataFrame]]:
    """The record of a shape, and the table of each receiver."""
    rng = np.random.default_rng(7)
    share = np.linspace(0, 1, ROWS)
    time_ns = np.round((shape.start_s + shape.duration_s * share) * 1e9).astype(np.int64)
    time_s, position = time_ns / 1e9, shape.course(share)
    swing = np.deg2rad(4) * np.sin(np.outer(time_s, [1.9, 1.6, 0.3]))
    beacons = np.tile(ARMS if shape.beacons is None else shape.beacons, (ROWS, 1, 1))
    drift = np.cumsum(rng.normal(0, 0.05, (ROWS, 1, 3)), axis=0) * [1, 1, 0]
    exact = not any(shape.reported_off_m)
    values = {
        "target.position": position,
        "target.velocity": np.gradient(position, time_s, axis=0),
        "platform.position": np.zeros((ROWS, 3)),
        "platform.attitude": swing,
        "platform.beacon_position": beacons,
        "platform.reported_beacon_position":
            beacons if exact else beacons + drift + shape.reported_off_m,
    }
    for name in shape.receivers:
        count = np.clip(np.arange(ROWS) - 1, 0, ROWS - 2)
        if name == "raw":
            error = rng.normal(0, shape.raw_noise_m, (ROWS, 3))
        else:
            error = rng.normal(0, shape.noise_m / 12, (ROWS, 3)).cumsum(axis=0) / 1.5
        values |= {
            f"{name}.update_count": count, f"{name}.epoch": time_s[count],
            f"{name}.position": position[count] + error, f"{name}.valid": count > 0,
        }
        if name != "raw":
            values[f"{name}.covariance"] = np.tile(shape.noise_m**2 * np.eye(6), (ROWS, 1, 1))
            values[f"{name}.position_std"] = np.full((ROWS, 3), shape.noise_m)
    record = Record(time_ns, values)
    return record, {name: track(record, name) for name in shape.receivers}
