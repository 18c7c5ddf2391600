"""What a log tells about the device that wrote it: numbers, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.special import chdtri, stdtrit

from ..data.estimates import Floats, Integers
from ..data.samples import Samples
from ..errors import ConfigurationError
from ..words.numbers import rounded
from . import positions
from .batch import refined
from .fit import Fit, fit, without_late
from .innovations import MOST_BEACONS, OFFSET, SCALE, Filtered, Ranges, evaluate
from .losses import Losses, losses
from .path import noise_of, smoothed, start
from .places import place_std
from .swings import CarrierSwing

Told = Literal[
    "yes", "not in this log", "not told apart from turns", "no late ranges beyond noise"
]
YES: Told = "yes"
NOT: Told = "not in this log"
TURNS: Told = "not told apart from turns"
NONE_LATE: Told = "no late ranges beyond noise"
MOST_RANGES = 12_000
"""Number of ranges that the likelihood takes; of more, whole rounds are left out evenly."""
MOST_READINGS = 3_000
LONGEST_SILENCE_S = 3600.0
"""Longest time without a range [s]: after it the diver may be anywhere, and sums lose digits."""
_ROUND_TRIP = 1e6
_Z = 1.959964
_VAGUE = 0.5
"""Standard deviation of a logarithm above which the log does not tell the number."""
_VAGUE_SHARE = 1.5
"""The same for the logarithm of a share's odds: late ranges are few."""
BEYOND = 3.0
"""Late ranges are told from noise if their mean excess is this many standard deviations."""
FEWEST_LATE = 3.0
ALIKE = 0.95
"""Correlation of scale and offset above which neither is told."""
LONG = 12.0
"""A slow error of positions is told if all series and axes together are that many times as long as
the upper end of its correlation time. A shorter log tells it only if it looks faster than it is."""
_CHANCE = 0.05
"""Probability with which equal offsets of beacons are taken for different ones."""
_WIDER = 1.1
_LEFT_OUT = 0.02
"""Standard deviation of the logarithm of the noise of a range by what the model leaves out, such as
errors of headings and a path between turns."""
_LAGS = 20
_LINEAR, CURVED = 1.15, 0.05
"""Factor of the standard deviations of scale and offsets: those of the linearised filter are too
small by that much in simulated logs, and the more so the less certain the scale is: by one more
at this standard deviation of it."""


@dataclass(frozen=True, slots=True)
class Number:
    """A parameter of the device.

    Attributes
    ----------
    parameter, unit
        Its name and unit; a beacon's number follows in brackets.
    estimate, low, high
        With the ends of the 95 % interval; None if the log does not tell it.
    told
        Whether the log tells it.
    explanation
        What it means, or why the log does not tell it.
    """

    parameter: str
    estimate: float | None
    low: float | None
    high: float | None
    unit: str
    told: Told
    explanation: str


@dataclass(frozen=True, slots=True)
class Assumed:
    """What is known about a device apart from its log.

    Attributes
    ----------
    sound_speed
        That the device assumes [m/s].
    place_std, place_down_std
        Uncertainty of the beacons' places, horizontal and down [m].
    offset_std, scale_std
        Uncertainty of a beacon's offset [m] and of the scale, before the log.
    depth_bias_std
        Of the depth sensor's constant error [m].
    clock_walk_psd
        Of the clock's random walk times the speed of sound [m²/s].
    place_noise_std, place_down_noise_std
        White error of a reported place, per horizontal axis and down [m].
    slot_s
        Time between two pings of a beacon [s]; None: the log's own.
    swings
        Of what carries the beacons.
    """

    sound_speed: float = 1500.0
    place_std: float = 0.0
    place_down_std: float = 0.0
    offset_std: float = 5.0
    scale_std: float = 0.1
    depth_bias_std: float = 0.05
    clock_walk_psd: float = 1e-6
    place_noise_std: float = 0.0
    place_down_noise_std: float = 0.0
    slot_s: float | None = None
    swings: tuple[CarrierSwing, ...] = ()


@dataclass(frozen=True, eq=False)
class Device:
    """Everything that a log tells.

    Attributes
    ----------
    numbers
        In the order of the tables.
    ranges, of_ranges
        The ranges that were used, and what the filter found in them.
    motion
        The most probable parameters of the ranges.
    correlation
        Of the scale with the offset of each beacon.
    remarks
        What a reader must know.
    wider
        Factor of all intervals, as residuals of a beacon are correlated in time; 1 if they are
        not.
    place_std
        Uncertainty of the places of fixed beacons [m]; None: the log does not tell it.
    """

    numbers: Sequence[Number]
    ranges: Ranges
    of_ranges: Filtered
    motion: Fit
    correlation: Mapping[int, float]
    remarks: Sequence[str]
    wider: float = 1.0
    place_std: float | None = None

    @property
    def known(self) -> Mapping[str, float]:
        """The numbers that the log tells, by parameter."""
        return {n.parameter: n.estimate for n in self.numbers
                if n.told == YES and n.estimate is not None}

    def white_std(self, late: float = 0.0) -> float:
        """Noise of a device without memory [m], of which as much can be expected.

        A walk counts with its scatter about its mean over the log, w √(T/6), and with that of the
        beacons. Late ranges that are not told count with theirs beside it, as far as there are more
        than receivers expect.

        Parameters
        ----------
        late
            Share of late ranges that receivers expect.
        """
        std, share, mean, *_, walk = self.motion.parameters.tolist()
        variance = std**2
        if self.motion.walks:
            variance += walk**2 * float(np.ptp(self.ranges.time)) / 6 + self.offsets_std**2
            if "late_share" not in self.known:
                more = max(share - late, 0.0)
                variance += more * mean**2 * (2 - more)
        return float(np.sqrt(variance)) * self.wider

    @property
    def offsets_std(self) -> float:
        """Standard deviation of the offsets of the beacons beyond their uncertainty [m].

        That of random effects (R. DerSimonian, N. Laird, Controlled Clinical Trials 7, 1986); 0 if
        the offsets differ by no more than chance.
        """
        rows = [n for n in self.numbers
                if n.parameter.startswith("range_offset") and n.parameter in self.known]
        if len(rows) < 2:
            return 0.0
        low, high = (np.array([getattr(n, end) for n in rows], float) for end in ("low", "high"))
        offset, weight = (low + high) / 2, ((high - low) / (2 * _Z)) ** -2.0
        total = float(weight.sum())
        free, off = len(rows) - 1, float(weight @ (offset - weight @ offset / total) ** 2)
        if off < chdtri(free, _CHANCE):
            return 0.0
        return float(np.sqrt((off - free) / (total - float(weight @ weight) / total)))


_LATE_ON_PLATFORM = (
    "late ranges are perhaps known less well than their intervals say: of 30 simulated dives by "
    "platforms drawn at random, the intervals held the true share in 71 %, the true mean in 73 %"
)


def device_of(samples: Samples, body: Floats | None = None, known: Assumed | None = None) -> Device:
    """Identify the device of a log.

    Parameters
    ----------
    body
        Positions of the beacons on a platform [m], if packets hold its pose.

    Raises
    ------
    ConfigurationError
        There are too few ranges, or too many beacons, a silence is too long, or no path explains
        the times and ranges.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            found = _device(samples, body, known or Assumed())
    except np.linalg.LinAlgError:
        found = None
    if found is None or not np.isfinite(found.motion.parameters).all():
        raise ConfigurationError(
            "log: must have ranges and depths that the path of a diver explains, to identify a "
            f"device, got {len(samples.range):,} ranges in "
            f"{rounded(float(np.ptp(samples.range_ns)) / 1e9)} s that none explains: check their "
            "times and units"
        )
    return found


def _check_silences(samples: Samples) -> None:
    time = np.sort(samples.range_ns)
    pause = np.diff(time) / 1e9
    longest = int(np.argmax(pause))
    if pause[longest] > LONGEST_SILENCE_S:
        raise ConfigurationError(
            f"log: must have a range at least every {LONGEST_SILENCE_S:,.0f} s, to identify a "
            f"device, got none for {pause[longest]:,.0f} s, after the first "
            f"{(time[longest] - time[0]) / 1e9:,.0f} s of ranges: if its clock jumps there, put it "
            "right; else identify one part"
        )


def _device(samples: Samples, body: Floats | None, known: Assumed) -> Device:
    """The same, whether or not its numbers are finite."""
    beacons = len(set(samples.beacon.tolist()))
    if len(samples.range) < 30 or beacons < 3:
        raise ConfigurationError(
            f"log: must have 30 ranges to three beacons or more, to identify a device, got "
            f"{len(samples.range)} to {beacons}"
        )
    count = int(samples.beacon.max()) + 1
    if count > MOST_BEACONS:
        raise ConfigurationError(f"log: must have at most {MOST_BEACONS} beacons, got {count}")
    _check_silences(samples)
    remarks: list[str] = []
    depth, depth_row = _depth(samples, known, remarks)
    ranges, noise = _ranges(samples, body, known, depth, remarks)
    found = fit(ranges, noise)
    if found.walks:
        remarks.append("offsets walk during the log, as where errors depend on the place: they are "
                       "those of its end")
    outcome = evaluate(ranges, found.parameters[None], found.hypotheses)
    beyond = _is_beyond(found, outcome)
    if not beyond:  # all that scatters is noise, then
        found = without_late(ranges, noise, found)
        outcome = evaluate(ranges, found.parameters[None], found.hypotheses)
    wider = _wider(ranges, outcome, remarks)
    at_once: Filtered | None = outcome
    posed = bool(samples.has_pose.any())
    if posed and not found.turns and not found.walks:  # beacons are close together: see refined
        at_once = refined(ranges, found.parameters, outcome)
    scale_rows, correlation = _scale_and_offsets(ranges, at_once or outcome, wider, found.walks)
    if at_once is None:
        why = "no track fits all ranges with them: many values are as probable"
        scale_rows = [_untold(row, NOT, why) for row in scale_rows]
    of_ranges = [*_of_ranges(ranges, found, wider, beyond), *scale_rows, _of_walk(found, wider)]
    if posed and any(row.parameter == "late_share" and row.told == YES for row in of_ranges):
        remarks.append(_LATE_ON_PLATFORM)
    places = None
    if not posed and not _drifting(samples):
        places = place_std(ranges, found)
    elif not posed:
        why = "the errors of the beacons' own reported positions add to those of the ranges"
        of_ranges = [_untold(row, NOT, why) for row in of_ranges]
    numbers = [
        *of_ranges,
        *_of_losses(losses(samples.range_ns, samples.beacon, known.slot_s)),
        depth_row, *_of_motion(found, wider, posed and bool(known.swings)),
        *_of_positions(samples, known.swings),
    ]
    return Device(numbers, ranges, outcome, found, correlation, remarks, wider, places)


def _depth(
    samples: Samples, known: Assumed, remarks: list[str]
) -> tuple[tuple[Floats, Floats, float] | None, Number]:
    """The smooth depth, at times [s] and with its variance; and the noise of a reading."""
    name, unit = "depth_std", "m"
    if len(samples.depth) < 10:
        remarks.append("no depth in this log: the diver is taken to stay at one depth")
        return None, _missing(name, unit, "there are fewer than 10 depth readings")
    every = -(-len(samples.depth) // MOST_READINGS)
    time, depth = samples.depth_ns / 1e9, samples.depth
    n = len(depth[::every])
    # The depth as a range to something very far away: the same filter takes it.
    prior = {
        "north": depth[0], "east": 0.0, "velocity_north": 0.0, "velocity_east": 0.0,
        "position_std": 1.0, "velocity_std": 0.5, "clock_std": 0.0, "clock_walk": 0.0,
        "scale_std": 0.0, "depth_bias_std": 0.0, "offset_std": 0.0, "place_std": 0.0,
        "place_down_std": 0.0, "place_noise_std": 0.0, "place_down_noise_std": 0.0,
    }
    far = np.zeros((n, 3))
    far[:, 0] = -_ROUND_TRIP
    series = Ranges(
        time[::every], np.zeros(n, np.intp), depth[::every] + _ROUND_TRIP, far, np.zeros(n),
        np.zeros(n), prior, 1,
    )
    noise = noise_of(time[::every], depth[::every], series.beacon)
    found = fit(series, noise, late=False, walk=False)
    std, _, _, psd, rate, turn, _ = found.parameters
    mean = psd + (rate * turn**2 if found.turns else 0.0)
    path, variance = smoothed(time, depth, float(std), float(mean))
    row = _logarithmic(name, *found.coordinate("range_std"), unit, "noise of a depth reading")
    return (time, path, variance), row


def _ranges(
    samples: Samples, body: Floats | None, known: Assumed,
    depth: tuple[Floats, Floats, float] | None, remarks: list[str],
) -> tuple[Ranges, float]:
    """The ranges as the likelihood takes them, and a guess of their noise."""
    place = samples.beacon_position(body)
    if samples.has_pose.any():
        remarks.append("positions are relative to the platform, whose own motion counts as the "
                       "diver's")
        place[samples.has_pose, :2] -= samples.position[samples.has_pose, :2]
    arrival = samples.range_ns / 1e9 + samples.range / known.sound_speed
    order = np.argsort(arrival, kind="stable")
    n = len(order)
    order = order[rounds(n, len(set(samples.beacon.tolist())))]
    if len(order) < n:
        remarks.append(f"{len(order):,} of {n:,} ranges are used, in whole rounds")
    time, beacon, range_ = arrival[order], samples.beacon[order], samples.range[order]
    place = place[order]
    if depth is None:
        down, variance, bias = np.full(len(order), place[:, 2].mean()), 0.0, 0.0
    else:
        down, variance = np.interp(time, depth[0], depth[1]), depth[2]
        bias = known.depth_bias_std
    noise = noise_of(time, range_, beacon)
    at, std = start(time, beacon, range_, place, down, noise)
    prior = {
        "north": at[0], "east": at[1], "velocity_north": at[2], "velocity_east": at[3],
        "position_std": std + min(known.offset_std, 1.0), "velocity_std": 1.0,
        "clock_std": 0.0, "clock_walk": known.clock_walk_psd, "scale_std": known.scale_std,
        "depth_bias_std": bias, "offset_std": known.offset_std, "place_std": known.place_std,
        "place_down_std": known.place_down_std if depth is not None else 0.0,
        "place_noise_std": known.place_noise_std,
        "place_down_noise_std": known.place_down_noise_std if depth is not None else 0.0,
    }
    return Ranges(
        time, beacon, range_, place, down, np.full(len(time), variance), prior,
        int(samples.beacon.max()) + 1,
    ), noise


def rounds(n: int, beacons: int) -> Integers:
    """Which of n ranges are used: all of them, or rounds of all beacons at regular intervals."""
    every = -(-n // MOST_RANGES)
    return np.flatnonzero(np.arange(n) // (2 * beacons) % every == 0)


def _drifting(samples: Samples) -> bool:
    """Whether beacons report positions of their own that change, as buoys do."""
    own = ~samples.has_pose
    return any(
        bool(np.ptp(samples.position[own & (samples.beacon == b)], axis=0).max() > 1e-6)
        for b in np.unique(samples.beacon[own])
    )


def _wider(ranges: Ranges, outcome: Filtered, remarks: list[str]) -> float:
    """Factor of all standard deviations, as residuals of a beacon may resemble each other."""
    residual = outcome.by_range["innovation"][0] / np.sqrt(outcome.by_range["variance"][0])
    residual = np.clip(residual, -3, 3)
    sums, counts = np.zeros(_LAGS), np.zeros(_LAGS)
    for b in np.unique(ranges.beacon):
        own = residual[ranges.beacon == b]
        own = own - own.mean()
        for lag in range(1, min(_LAGS, len(own) - 1)):
            sums[lag] += float(own[lag:] @ own[:-lag])
            counts[lag] += len(own) - lag
    power = float(np.mean((residual - residual.mean()) ** 2))
    share = sums[1:] / np.maximum(counts[1:], 1) / max(power, 1e-9)
    noise = 3 / np.sqrt(np.maximum(counts[1:], 1))
    short = np.flatnonzero(share < noise)
    total = float(share[: short[0] if len(short) else len(share)].sum())
    factor = float(np.sqrt(1 + 2 * total))
    if factor < _WIDER:
        return 1.0
    remarks.append(
        f"residuals of a beacon are correlated in time ({share[0]:.2f} with the one before): "
        f"intervals are {factor:.1f} times as wide as if they were independent"
    )
    return factor


def _is_beyond(found: Fit, outcome: Filtered) -> bool:
    """Whether late ranges can be told from noise: some are, each by itself."""
    std, share, mean, *_ = found.parameters
    punctual = outcome.by_range["punctual"][0]
    late = min(share * len(punctual), float(np.sum(punctual < 0.5)))
    return bool(mean >= BEYOND * std and late >= FEWEST_LATE)


def _of_ranges(ranges: Ranges, found: Fit, wider: float, beyond: bool) -> list[Number]:
    """Noise and late ranges."""
    at = dict(zip(found.names, found.at.tolist(), strict=True))
    sd = {name: found.coordinate(name)[1] * wider for name in found.names}
    share = float(found.parameters[1])
    own = float(np.hypot(sd["range_std"], _LEFT_OUT))
    noise = _logarithmic("range_std", at["range_std"], own, "m", "noise of a range")
    if not beyond:
        why = f"fewer than {FEWEST_LATE:.0f}, or within {BEYOND:.0f} times the noise"
        return [noise, *(Number(name, None, None, None, unit, NONE_LATE, why)
                         for name, unit in (("late_share", ""), ("late_mean", "m")))]
    # Late ranges are few: their numbers have the tails of Student's distribution.
    tails = float(stdtrit(max(share * len(ranges.range) - 1, 1), 0.975)) / _Z
    logit = at["late_share"] + np.array([0.0, -_Z, _Z]) * sd["late_share"] * tails
    late = (1 / (1 + np.exp(-logit))).tolist()
    rows = [
        Number("late_share", late[0], late[1], late[2], "", YES, "share of ranges that are late"),
        _logarithmic("late_mean", at["late_mean"], sd["late_mean"] * tails, "m",
                     "their mean excess"),
    ]
    if sd["late_share"] * tails > _VAGUE_SHARE:
        rows[0] = _untold(rows[0], NOT, f"{rows[0].explanation}: {late[1]:.2g} to {late[2]:.2g}")
    if found.turns:
        return [noise, *(_untold(row, TURNS, "a turn resembles a late range at first")
                         for row in rows)]
    return [noise, *rows]


def _scale_and_offsets(
    ranges: Ranges, outcome: Filtered, wider: float, walk: bool
) -> tuple[list[Number], dict[int, float]]:
    """Scale and offsets by beacon, and the correlation of the scale with each offset."""
    what = "error of the ranges to this beacon at the end" if walk else (
        "constant error of the ranges to this beacon"
    )
    mean, P = outcome.mean[0], outcome.covariance[0]
    wider *= _LINEAR * (1 + float(np.sqrt(P[SCALE, SCALE])) / CURVED)
    heard = np.unique(ranges.beacon)
    of = OFFSET + heard
    alike = P[SCALE, of] / np.sqrt(P[SCALE, SCALE] * np.diag(P)[of])
    rows = [_normal("range_scale", mean[SCALE], np.sqrt(P[SCALE, SCALE]) * wider, "",
                    "share by which ranges are too long")]
    rows += [
        _normal(f"range_offset[{b + 1}]", mean[i], np.sqrt(P[i, i]) * wider, "m", what)
        for b, i in zip(heard.tolist(), of.tolist(), strict=True)
    ]
    why = "at these distances they are alike (correlation of scale and offset {:.2f})"
    least = float(alike[np.argmin(np.abs(alike))])
    same = [least, *alike.tolist()]
    return [
        _untold(row, NOT, why.format(own)) if abs(own) > ALIKE else row
        for row, own in zip(rows, same, strict=True)
    ], dict(zip(heard.tolist(), alike.tolist(), strict=True))


def _of_walk(found: Fit, wider: float) -> Number:
    """How far the error of a beacon's ranges walks in a second."""
    name, unit = "range_walk", "m/√s"
    if not found.walks:
        return _missing(name, unit, "constant offsets explain the ranges as well")
    at, sd = found.coordinate(name)
    return _logarithmic(name, at, sd * wider, unit, "walk of a beacon's offset in a second")


def _of_losses(found: Losses | None) -> list[Number]:
    names = ("loss_share", "loss_burst")
    if found is None:
        why = "pings come at no regular interval"
        return [_missing(names[0], "", why), _missing(names[1], "pings", why)]
    share = Number(names[0], *found.share, "", YES,
                   f"share of pings lost, of one every {found.slot_s:g} s from each beacon")
    if found.burst is None:
        return [share, _missing(names[1], "pings", "no ping is missing")]
    return [share, Number(names[1], *found.burst, "pings", YES, "mean number lost in a row")]


def _of_motion(found: Fit, wider: float, swings: bool) -> list[Number]:
    def row(name: str, unit: str, what: str) -> Number:
        at, sd = found.coordinate(name)
        return _logarithmic(name, at, sd * wider, unit, what)

    psd = row("acceleration_psd", "m²/s³", "density of the diver's white acceleration")
    if swings:
        psd = _untold(psd, NOT, "the platform's own swings add to the diver's motion")
    names = (("turn_rate", "1/s", "turns a second"),
             ("turn_std", "m/s", "change of the velocity at a turn, per axis"))
    if not found.turns:
        why = "steady motion explains the ranges as well"
        return [psd, *(_missing(name, unit, why) for name, unit, _ in names)]
    turns = [row(*each) for each in names]
    if swings:
        return [psd, *turns]
    return [_untold(psd, TURNS, "the diver moves by turns, with little between them"), *turns]


def _of_positions(samples: Samples, swings: Sequence[CarrierSwing]) -> list[Number]:
    """Parts of the error of the platform's, or of the beacons' own, reported positions."""
    names = (("gps_std", "m"), ("gps_markov_std", "m"), ("gps_correlation_time", "s"))
    what = ("white part of the reported positions", "slow part, the platform's own motion included",
            "its correlation time")
    if swings:
        what = (what[0], "slow part, without the platform's swings", what[2])
    posed, time = samples.has_pose, samples.range_ns / 1e9
    carriers = [posed] if posed.any() else [samples.beacon == b for b in np.unique(samples.beacon)]
    found = positions.parts([(time[c], samples.position[c][:, :2]) for c in carriers], swings)
    if found is None:
        few = max(int(np.sum(c)) for c in carriers) < positions.FEW
        why = "too few positions are reported" if few else "reported positions do not change"
        return [_missing(name, unit, why) for name, unit in names]
    white, slow = found.there
    short = LONG * float(np.exp(found.ends[1, 2])) > found.span_s
    rows = []
    for i, ((name, unit), there) in enumerate(zip(names, (white, slow, slow), strict=True)):
        estimate, low, high = np.exp([found.at[i], *found.ends[:, i]]).tolist()
        row = Number(name, estimate, low, high, unit, YES, what[i])
        if not there:
            row = _untold(row, NOT, f"the positions show no {('white', 'slow')[i > 0]} part")
        elif i > 0 and short:
            row = _untold(row, NOT, "its correlation time may be too long for this log")
        elif np.log(high / low) > 2 * _Z * _VAGUE:
            row = _untold(row, NOT, f"{what[i]}: only known to a factor of "
                                    f"{np.sqrt(high / low):.2g}")
        rows.append(row)
    return rows


# --- Rows -----------------------------------------------------------------------------------------


def _logarithmic(name: str, at: Any, sd: Any, unit: str, what: str) -> Number:
    """A number whose logarithm has this estimate and standard deviation."""
    estimate, low, high = np.exp(at + np.array([0.0, -_Z, _Z]) * sd).tolist()
    row = Number(name, estimate, low, high, unit, YES, what)
    return row if sd < _VAGUE else _untold(row, NOT, f"{what}: only known to a factor of "
                                           f"{np.exp(_Z * sd):.2g}")


def _normal(name: str, at: Any, sd: Any, unit: str, what: str) -> Number:
    return Number(name, float(at), float(at - _Z * sd), float(at + _Z * sd), unit, YES, what)


def _missing(name: str, unit: str, why: str) -> Number:
    return Number(name, None, None, None, unit, NOT, why)


def _untold(row: Number, told: Told, why: str) -> Number:
    return replace(row, told=told, explanation=why)
