"""A record made by hand: a diver who swims north at 0.5 m/s, 10 m east of the platform."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
from sblcosim.data.record import Record
from sblcosim.data.truth import of_record
from sblcosim.judge import metrics
from sblcosim.judge.definitions import Judged

STEP_NS = 100_000_000
BEACONS = np.array([[3.0, 0, 0.5], [0, 3, 0.5], [-3, 0, 0.5], [0, -3, 0.5]])
NORTH = {"ekf": np.array([[1.0, 0, 0]])}


def make_record(
    errors: Mapping[str, np.ndarray] = NORTH,
    *,
    platform_error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    variance: float = 0.25,
    optional_ports: bool = True,
) -> Record:
    """A run of 101 rows, 0.1 s apart.

    `errors` holds each receiver's position errors, shape (m, 3), or one for all 99: estimate k = 1
    … m appears at instant k + 1 and belongs to instant k. All receivers claim `variance` for each
    state.
    """
    n = 101
    time_s = np.arange(n) * 0.1
    position = np.column_stack([0.5 * time_s, np.full(n, 10.0), np.full(n, 5.0)])
    velocity = np.tile([0.5, 0.0, 0.0], (n, 1))
    values = {
        "target.position": position,
        "target.velocity": velocity,
        "platform.position": np.zeros((n, 3)),
        "platform.attitude": np.deg2rad(5) * np.sin(np.outer(time_s, [1.9, 1.6, 0.3])),
        "platform.beacon_position": np.tile(BEACONS, (n, 1, 1)),
        "platform.reported_beacon_position": np.tile(BEACONS, (n, 1, 1)) + platform_error,
    }
    for name, error in errors.items():
        m = n - 2 if len(error) == 1 else len(error)
        count = np.clip(np.arange(n) - 1, 0, m)
        shift = np.zeros((n, 3))
        shift[2 : m + 2] = error
        values |= {
            f"{name}.update_count": count,
            f"{name}.epoch": time_s[count],
            f"{name}.position": position[count] + shift,
        }
        if optional_ports:
            values |= {
                f"{name}.valid": count > 0,
                f"{name}.velocity": velocity,
                f"{name}.position_std": np.full((n, 3), np.sqrt(variance)),
                f"{name}.covariance": np.tile(variance * np.eye(6), (n, 1, 1)),
                f"{name}.nis": np.full(n, 5.0),
                f"{name}.nis_degrees": np.full(n, 5),
            }
    return Record(np.arange(n) * STEP_NS, values)


def silent(receiver: str) -> Record:
    """The same run with a receiver that never has a fix."""
    record = make_record()
    values = {
        name: np.zeros_like(value) if name.startswith(f"{receiver}.") else value
        for name, value in record.values.items()
    }
    return Record(record.time_ns, values)


def judged_in(record: Record, receiver: str) -> Judged:
    """A receiver's estimates in a record, none of them broken, with the truth there."""
    return metrics.intact(receiver, record.estimates(receiver), of_record(record))


def track(record: Record, receiver: str) -> pd.DataFrame:
    """The table of these."""
    return metrics.track(judged_in(record, receiver))


def summary(
    record: Record, receivers: Iterable[str], interval_ns: int | None = None
) -> pd.DataFrame:
    """The summary of a record."""
    judged = {name: judged_in(record, name) for name in receivers}
    tracks = {name: metrics.track(own) for name, own in judged.items()}
    return metrics.summary(judged, tracks, of_record(record), record, interval_ns)
