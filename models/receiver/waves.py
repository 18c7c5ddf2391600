"""What waves do to the platform and a receiver does not estimate: heave and swing.

Heave h is the depth of the platform's reference point: it floats. Swing t is the tilt, north and
east, where packets hold only their own beacon's position. It moves a beacon that is b_z below the
reference point by b_z t. Both are Gauss-Markov processes about 0, and no states of `surroundings`.
Bounds and smoothers add them as states (`HEAVE`, `SWING`). The filter keeps them apart, in a
two-stage filter (B. Friedland, Treatment of bias in recursive filtering, IEEE Trans. Autom. Control
14, 1969, 359-367): all reports together say h = d − k s + e, with states s and an error e of
variance V, and the innovation of the next report says something of s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from . import surroundings
from .surroundings import (
    GPS_ERROR,
    HEADING,
    HEADING_ERROR,
    LEAST_SOUNDING_STD,
    PLATFORM,
    VERTICAL_ERROR,
    Elements,
    Measurement,
    Pose,
    Range,
)

HEAVE, SWING = surroundings.STATES, (surroundings.STATES + 1, surroundings.STATES + 2)
"""h [m] and t [rad], after the states of `surroundings`."""
STATES = surroundings.STATES + 3


def decay(m: Any, std: Any, tau: Any, dt: Any) -> tuple[Any, Any]:
    """What is left of a Gauss-Markov process after dt [s], and the variance of what is new."""
    kept = m.exp(-dt / tau)
    return kept, std**2 * (1 - kept**2)


def prior_stds(p: Any) -> dict[int, Any]:
    """As `surroundings.prior_stds`, with heave and swing."""
    return {
        **surroundings.prior_stds(p), HEAVE: p.heave_std, **dict.fromkeys(SWING, p.tilt_std),
    }


def transition(m: Any, p: Any, dt: Any) -> tuple[Elements, Elements]:
    """As `surroundings.transition`, with heave and swing."""
    phi, Q = surroundings.transition(m, p, dt)
    for states, std, tau in (
        ((HEAVE,), p.heave_std, p.heave_time), (SWING, p.tilt_std, p.tilt_time)
    ):
        kept, new = decay(m, std, tau, dt)
        for i in states:
            phi[i, i], Q[i, i] = kept, new
    return phi, Q


def report_variance(m: Any, p: Any, own: Any, body: Sequence[Any]) -> Any:
    """Variance of the white noise of a reported depth of the reference point [m²].

    Parameters
    ----------
    own
        Whether it follows from that of the packet's own beacon: 0 or 1. Tilt is unknown then.
    body
        Nominal position of that beacon in the body frame [m].
    """
    tilted = (body[0] ** 2 + body[1] ** 2) * (p.tilt_std**2 + p.imu_tilt_std**2)
    return m.fmax(p.gps_vertical_std, LEAST_SOUNDING_STD) ** 2 + own * tilted


def down(m: Any, p: Any, x: Sequence[Any], own: Any, body: Sequence[Any]) -> Measurement:
    """A reported depth of the reference point, with heave as a state."""
    variance = report_variance(m, p, own, body)
    return Measurement(x[HEAVE] + x[VERTICAL_ERROR], {HEAVE: 1, VERTICAL_ERROR: 1}, variance)


def places(m: Any, p: Any, x: Sequence[Any], body: Sequence[Any]) -> tuple[Measurement, ...]:
    """As `surroundings.places`, with swing as a state."""
    return tuple(
        replace(row, value=row.value + body[2] * x[i], row={**row.row, i: body[2]})
        for i, row in zip(SWING, surroundings.places(m, p, x, body), strict=True)
    )


def range_(m: Any, p: Any, x: Sequence[Any], pose: Pose, body: Sequence[Any]) -> Range:
    """As `surroundings.range_`, with swing as a state."""
    lever = pose.own * body[2]
    row = surroundings.range_(
        m, p, x, replace(pose, swing=tuple(lever * x[i] for i in SWING)), body
    )
    return replace(row, row={**row.row, **{i: -lever * row.u[n] for n, i in enumerate(SWING)}})


@dataclass(frozen=True, slots=True)
class Heave:
    """h = d − k g_z + e, as far as reports tell.

    Attributes
    ----------
    down
        d [m].
    share
        k.
    variance
        V [m²].
    """

    down: Any
    share: Any
    variance: Any

    @property
    def numbers(self) -> tuple[Any, ...]:
        """All numbers; `heave_of` makes a heave of them."""
        return self.down, self.share, self.variance


def heave_of(numbers: Sequence[Any]) -> Heave:
    """The heave of these numbers."""
    return Heave(*numbers)


def no_heave(p: Any) -> Heave:
    """Before the first report."""
    return Heave(0, 0, p.heave_std**2)


def heave_later(m: Any, p: Any, heave: Heave, dt: Any, moved: Any, drift: Any) -> Heave:
    """After dt [s] without a report.

    Parameters
    ----------
    moved, drift
        Expected change of g_z [m], and the variance of its change [m²].
    """
    kept, new = decay(m, p.heave_std, p.heave_time, dt)
    share = kept * heave.share
    return Heave(
        kept * heave.down + share * moved, share,
        kept**2 * heave.variance + share**2 * drift + new,
    )


def down_after(m: Any, p: Any, heave: Heave, own: Any, body: Sequence[Any]) -> Measurement:
    """A reported depth as a measurement of g_z, after all reports before it."""
    variance = heave.variance + report_variance(m, p, own, body)
    return Measurement(heave.down, {VERTICAL_ERROR: 1 - heave.share}, variance)


def heaved(heave: Heave, row: Measurement, z: Any, weight: Any) -> Heave:
    """After a reported depth z, of which `row` is `down_after`; it counts by `weight`, 0 or 1."""
    gain = weight * heave.variance / row.variance
    return Heave(
        heave.down + gain * (z - heave.down),
        heave.share + gain * (1 - heave.share),
        (1 - gain) * heave.variance,
    )


@dataclass(frozen=True, slots=True)
class Swing:
    """t = d − k (p + g) − l (ψ + e_ψ) + e, as far as reports tell.

    Attributes
    ----------
    tilt
        d, north and east [rad].
    share
        k [rad/m].
    turned
        l, north and east.
    variance
        V of each part [rad²].
    """

    tilt: Sequence[Any]
    share: Any
    turned: Sequence[Any]
    variance: Any

    @property
    def numbers(self) -> tuple[Any, ...]:
        """All numbers; `swing_of` makes a swing of them."""
        return *self.tilt, self.share, *self.turned, self.variance

    def at(self, x: Sequence[Any]) -> tuple[Any, Any]:
        """Estimate of t at a state, north and east [rad]."""
        (*place, angle) = causes(x)
        north, east = (
            self.tilt[i] - self.share * place[i] - self.turned[i] * angle for i in range(2)
        )
        return north, east


def swing_of(numbers: Sequence[Any]) -> Swing:
    """The swing of these numbers."""
    north, east, share, by_north, by_east, variance = numbers
    return Swing((north, east), share, (by_north, by_east), variance)


def causes(x: Sequence[Any]) -> tuple[Any, Any, Any]:
    """p + g, north and east, and ψ + e_ψ."""
    north, east = (x[i] + x[j] for i, j in zip(PLATFORM, GPS_ERROR, strict=True))
    return north, east, x[HEADING] + x[HEADING_ERROR]


def no_swing(p: Any) -> Swing:
    """Before the first report."""
    return Swing((0, 0), 0, (0, 0), p.tilt_std**2)


def swing_later(
    m: Any, p: Any, swing: Swing, dt: Any, moved: Sequence[Any], drift: Sequence[Any]
) -> Swing:
    """After dt [s] without a report.

    Parameters
    ----------
    moved
        Expected changes of p + g, north and east [m], and of ψ + e_ψ [rad].
    drift
        Variances of the changes of p + g, each part [m²], and of ψ + e_ψ [rad²].
    """
    kept, new = decay(m, p.tilt_std, p.tilt_time, dt)
    share, turned = kept * swing.share, tuple(kept * v for v in swing.turned)
    turning = 0.5 * (turned[0] ** 2 + turned[1] ** 2)
    return Swing(
        tuple(kept * swing.tilt[i] + share * moved[i] + turned[i] * moved[2] for i in range(2)),
        share, turned,
        kept**2 * swing.variance + share**2 * drift[0] + turning * drift[1] + new,
    )


def places_after(
    x: Sequence[Any], rows: Sequence[Measurement], lever: Any, swing: Swing
) -> tuple[Measurement, ...]:
    """Reported north and east of a point as measurements of states, after all reports before them.

    Parameters
    ----------
    rows
        `surroundings.places` of the point.
    lever
        Its b_z [m].
    """
    tilt, free = swing.at(x), 1 - lever * swing.share
    variance = lever**2 * swing.variance
    found = []
    for i, row in enumerate(rows):
        turn = row.row[HEADING] - lever * swing.turned[i]
        found.append(Measurement(
            row.value + lever * tilt[i],
            {PLATFORM[i]: free, GPS_ERROR[i]: free, HEADING: turn, HEADING_ERROR: turn},
            row.variance + variance,
        ))
    return tuple(found)


def swung(
    x: Sequence[Any], rows: Sequence[Measurement], z: Sequence[Any], lever: Any, swing: Swing,
    weight: Any,
) -> Swing:
    """After reports z of a point, north and east [m]; they count by `weight`, 0 or 1.

    Parameters
    ----------
    x
        State before the reports.
    rows, lever
        See `places_after`.
    """
    white = 0.5 * (rows[0].variance + rows[1].variance)
    gain = weight * lever * swing.variance / (lever**2 * swing.variance + white)
    (*place, angle) = causes(x)
    turns = [row.row[HEADING] for row in rows]
    tilts = [z[i] - rows[i].value + place[i] + turns[i] * angle for i in range(2)]

    def learnt(known: Any, told: Any) -> Any:
        return known + gain * (told - lever * known)

    return Swing(
        tuple(map(learnt, swing.tilt, tilts)), learnt(swing.share, 1),
        tuple(map(learnt, swing.turned, turns)), (1 - gain * lever) * swing.variance,
    )


def range_after(row: Range, lever: Any, swing: Swing) -> Range:
    """A range with what it says of the states that the swing of its beacon depends on."""
    share, turned = lever * swing.share, [lever * v for v in swing.turned]
    u = row.u[:2]
    turn = u[0] * turned[0] + u[1] * turned[1]
    return replace(row, row={
        **row.row,
        **{i: (share - 1) * v for i, v in zip(PLATFORM, u, strict=True)},
        **{i: share * v for i, v in zip(GPS_ERROR, u, strict=True)},
        HEADING: row.row[HEADING] + turn,
        HEADING_ERROR: turn,
    })
