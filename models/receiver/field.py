"""The model of `long_baseline`: the diver, the clock, and the true position of each beacon.

Formulas on scalars for two uses, as in `surroundings`: ``m`` is ``casadi`` or ``numpy``. Beacon i
is at ŝ_i + e_i, where ŝ_i is its known position and e_i its error, with three states each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .surroundings import Measurement, sounding_variance, white_acceleration

POSITION, VELOCITY = (0, 2, 4), (1, 3, 5)
"""x [m] and v [m/s] of the diver, NED, in the order of the paper's state."""
CLOCK, SPEED, DEPTH_BIAS = 6, 7, 8
"""β [m], κ and d [m], as in `surroundings`."""
_FIRST = 9


def states(beacons: int) -> int:
    """Number of states."""
    return _FIRST + 3 * beacons


def error(beacon: int) -> tuple[int, int, int]:
    """Indices of e_i [m]: north, east, down."""
    first = _FIRST + 3 * beacon
    return first, first + 1, first + 2


def prior_stds(p: Any) -> dict[int, Any]:
    """Standard deviations of all states except the diver's, before any measurement."""
    stds = {CLOCK: p.clock_std, SPEED: p.sound_speed_std, DEPTH_BIAS: p.depth_bias_std}
    for i in range(p.beacons):
        stds |= dict(zip(error(i), _error_stds(p), strict=True))
    return stds


def _error_stds(p: Any) -> tuple[Any, Any, Any]:
    return p.beacon_error_std, p.beacon_error_std, p.beacon_vertical_error_std


def transition(
    m: Any, p: Any, dt: Any, psd: Any = None
) -> tuple[dict[tuple[int, int], Any], ...]:
    """Φ without its ones, and the upper triangle of Q, over ``dt`` [s], by row and column.

    Parameters
    ----------
    psd
        Density of the diver's acceleration [m²/s³]; None: that of the parameters.
    """
    psd = p.acceleration_psd if psd is None else psd
    phi, Q = white_acceleration(psd, dt, POSITION, VELOCITY)
    Q[CLOCK, CLOCK] = p.clock_walk_psd * dt
    decay = m.exp(-dt / p.beacon_error_time)
    for beacon in range(p.beacons):
        for i, std in zip(error(beacon), _error_stds(p), strict=True):
            phi[i, i], Q[i, i] = decay, std**2 * (1 - decay**2)
    return phi, Q


def depth(p: Any, x: Sequence[Any]) -> Measurement:
    """A reading of the depth sensor."""
    down = POSITION[2]
    return Measurement(
        x[down] + x[DEPTH_BIAS], {down: 1, DEPTH_BIAS: 1}, sounding_variance(p.depth_std)
    )


def range_(
    m: Any, p: Any, x: Sequence[Any], known: Sequence[Any], which: Sequence[Any],
    about: Sequence[Any] | None = None,
) -> Measurement:
    """A range to one of the beacons.

    Parameters
    ----------
    known
        ŝ_i, NED [m].
    which
        Whether it is the range to this beacon, one per beacon: 0 or 1.
    about
        Position of the beacon at which to linearise, NED [m]; None: its estimate.
    """
    off = [
        sum(which[i] * x[error(i)[n]] for i in range(p.beacons)) for n in range(3)
    ]
    o = [x[POSITION[n]] - known[n] - off[n] for n in range(3)]
    distance = m.sqrt(m.fmax(o[0] * o[0] + o[1] * o[1] + o[2] * o[2], 1e-12))
    stretch = 1 + x[SPEED]
    if about is not None:
        o = [x[POSITION[n]] - about[n] for n in range(3)]
    length = m.sqrt(m.fmax(o[0] * o[0] + o[1] * o[1] + o[2] * o[2], 1e-12))
    u = [stretch / length * a for a in o]
    row = {POSITION[n]: u[n] for n in range(3)}
    row |= {CLOCK: 1, SPEED: length}
    row |= {error(i)[n]: -which[i] * u[n] for i in range(p.beacons) for n in range(3)}
    white = (u[0] * u[0] + u[1] * u[1]) * p.beacon_noise_std**2
    return Measurement(
        stretch * distance + x[CLOCK], row,
        sounding_variance(p.range_std) + white + u[2] * u[2] * p.beacon_vertical_noise_std**2,
    )
