"""Calibration of the acoustic hardware in simulation (the paper's section 2.3).

Two tests through the Acoustics component:

- the speed of sound from ranges over a known distance (10 m in the paper);
- the range test of the paper's Figure 6: ranges at 0 to 100 m in steps of 5 m against the truth.

The receiver forms a range with the assumed speed, r = c₀ (τ + ε), where τ = d/c is the travel time
and ε is the error of clocks and delays. With ε taken as zero, one known distance gives
ĉ = c₀ d / r̄. A line through several distances, r = a + b d, gives ĉ = c₀ / b and ε̂ = a / c₀
separately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast
from warnings import warn

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.fmus.stopping import interruptible
from sblcosim.models.declaration import Variable
from sblcosim.models.ports import BEACON_POSITIONS, BEACONS, MOTION

from . import artifacts, style
from .answer import Answer
from .catalogue import Figure, Job, by_name, jobs
from .data.estimates import Floats
from .data.record import Record
from .errors import ConfigurationError, ConfigurationWarning, check_choice
from .layout import fitted
from .results.figures import run as figures
from .results.range_test import RANGE_TEST
from .scenario.doubts import of_sound_speed
from .shown import Picture
from .simulation.masters.python import execute
from .simulation.resolve import resolve
from .simulation.system import ComponentSpec, Connection, PythonComponent, System

SLOT_NS = SECOND
"""Time between pings [ns]. Nothing moves, so any value will do."""
RANGE_TEST_M = tuple(float(d) for d in range(0, 101, 5))
"""Distances of the paper's range test [m]."""


@dataclass(frozen=True, slots=True)
class SoundSpeed:
    """An estimated speed of sound.

    Attributes
    ----------
    value
        Speed of sound [m/s].
    std
        Standard uncertainty [m/s].
    """

    value: float
    std: float


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationResult(Answer):
    """The results of the two tests.

    Attributes
    ----------
    settings
        The arguments of `calibrate`.
    known_distance
        Speed of sound from the known distance. Its uncertainty follows from the scatter of the
        ranges and from that of the distance; errors of clock and delay are not included.
    per_ping_m_s
        The same uncertainty for a single ping [m/s], without that of the distance.
    line
        Speed of sound from the slope of the range test.
    intercept_m, intercept_std_m
        The line's range at distance 0, and its standard uncertainty [m].
    slope, slope_std
        Slope of the line, and its standard uncertainty, without unit.
    table
        The range test, one row per distance: ``distance_m``, ``pings``, ``mean_m`` and ``std_m``
        of the ranges, and ``error_m``, mean minus distance.
    """

    document = "calibrate"
    columns = MappingProxyType({"range_test": RANGE_TEST})

    settings: Mapping[str, Any]
    known_distance: SoundSpeed
    per_ping_m_s: float
    line: SoundSpeed
    intercept_m: float
    intercept_std_m: float
    slope: float
    slope_std: float
    table: pd.DataFrame

    def plot(
        self, axes: Sequence[Axes] | None = None, theme: style.ThemeName = "light"
    ) -> Picture:
        """The range test, two axes; see `sblcosim.results.figures.run.plot_range_test`."""
        return Picture(figures.plot_range_test(*_range_test(self), axes, theme), axes)

    def to_json(self) -> dict[str, Any]:
        """Everything as plain data."""
        plain: dict[str, Any] = artifacts.plain(
            {
                "settings": self.settings,
                "known_distance": asdict(self.known_distance),
                "per_ping_m_s": self.per_ping_m_s,
                "line": asdict(self.line),
                "intercept_m": self.intercept_m,
                "intercept_std_m": self.intercept_std_m,
                "slope": self.slope,
                "slope_std": self.slope_std,
                "table": self.table.to_dict(orient="records"),
            }
        )
        return plain

    def manifest(self) -> dict[str, Any]:
        """The arguments, and the outcome."""
        return {"calibration": self.to_json()}

    @property
    def title(self) -> str:
        """Of a page."""
        return "Calibration"

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The range test."""
        return {"range_test": self.table}

    @property
    def figures(self) -> list[Job]:
        """The range test."""
        return jobs(FIGURES, self)

    @property
    def answer(self) -> str:
        """The speed of sound from both tests, and the line of the second, one line each."""
        s, known, line = self.settings, self.known_distance, self.line
        offset_us = self.intercept_m / s["assumed_sound_speed"] * 1e6
        return "\n".join(
            (
                f"Speed of sound: true {s['sound_speed']:g} m/s, assumed for ranging "
                f"{s['assumed_sound_speed']:g} m/s",
                f"  from {s['pings']} ranges over {s['distance']:g} m: "
                f"{known.value:.1f} ± {known.std:.1f} m/s"
                f" (standard deviation of a single ping {self.per_ping_m_s:.1f} m/s)",
                f"  from the slope of the range test:   {line.value:.2f} ± {line.std:.2f} m/s",
                f"Range test: range = {self.intercept_m:.4f} m (± {self.intercept_std_m:.4f}) + "
                f"{self.slope:.5f} (± {self.slope_std:.5f}) × distance",
                f"  the intercept is an error of clock and delay of {offset_us:.1f} µs",
            )
        )

    @property
    def remarks(self) -> list[str]:
        """Remarks that are needed to read the numbers."""
        return ["± is one standard uncertainty; that of the known distance leaves out clock and "
                "delay"]

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The answer, then the range test.

        Parameters
        ----------
        verbose
            Has no effect.
        width
            Columns to fit into; None: lines are not wrapped.
        """
        rows = self.table.to_string(
            index=False,
            formatters=dict.fromkeys(("mean_m", "std_m", "error_m"), "{:.3f}".format),
        )
        remarks = [f"  {line}" for line in self.remarks]
        return fitted("\n".join((self.answer, *remarks, "", rows)), width)

    def _gist(self) -> str:
        known = self.known_distance
        return f"of the speed of sound: {known.value:.1f} ± {known.std:.1f} m/s"


def _range_test(
    calibration: CalibrationResult,
) -> tuple[Floats, Floats, Floats, tuple[float, float]]:
    """Description of the figure."""
    distance, mean, std = calibration.table[["distance_m", "mean_m", "std_m"]].to_numpy().T
    return distance, mean, std, (calibration.intercept_m, calibration.slope)


FIGURES: Mapping[str, Figure[CalibrationResult]] = by_name(
    Figure("range_test", figures.plot_range_test, _range_test),
)
"""The figures in a calibration's folder."""


@interruptible
def calibrate(
    *,
    sound_speed: float = 1530.0,
    assumed_sound_speed: float = 1500.0,
    range_std: float = 0.1,
    clock_offset: float = 0.0,
    processing_delay: float = 0.0,
    processing_delay_correction: float = 0.0,
    distance: float = 10.0,
    distance_std: float = 0.0,
    distances: Sequence[float] = RANGE_TEST_M,
    pings: int = 100,
    seed: int = 1,
    fmi: Literal[2, 3] = 2,
    acoustics: Path | Callable[[], PythonComponent] | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> CalibrationResult:
    """Measure the speed of sound over a known distance, and test ranges over many distances.

    Parameters
    ----------
    sound_speed, assumed_sound_speed
        True speed, and the speed that ranging assumes [m/s].
    range_std
        Standard deviation of a range's white noise [m].
    clock_offset
        Receiver's clock minus the transmitter's [s].
    processing_delay, processing_delay_correction
        Time before an arrival is stamped, and the receiver's correction for it [s].
    distance, distance_std
        Known distance and its standard uncertainty [m].
    distances
        True distances of the range test [m]; at least three.
    pings
        Pings per distance; at least two.
    seed
        Seed of the noise.
    fmi
        FMI version of the Acoustics FMU.
    acoustics
        An Acoustics component instead of ours: an FMU, or a callable that makes a Python component.
    before
        Called with what is known of the manifest, before the first ping.

    Raises
    ------
    ConfigurationError
        An argument is out of range.
    """
    settings = {k: v for k, v in locals().items() if k not in ("fmi", "acoustics", "before")}
    _check(settings)
    check_choice("calibrate fmi", fmi, (2, 3))
    if before is not None:
        before({"calibration": {"settings": artifacts.plain(settings)}})
    if acoustics is None:
        from sblcosim.fmus.build.factory import build

        acoustics = build("acoustics", fmi)
    ranges = _ping(settings, acoustics)
    for name in ("sound_speed", "assumed_sound_speed"):
        problem = of_sound_speed(settings[name])
        if problem is not None:
            warn(f"calibrate {name}: {problem}", ConfigurationWarning, stacklevel=3)
    return _evaluate(settings, ranges)


def _ping(
    settings: Mapping[str, Any], acoustics: Path | Callable[[], PythonComponent]
) -> Floats:
    """Ranges of all pings [m]; a row for the known distance, then one for each other distance."""
    parameters = {
        name: settings[name]
        for name in (
            "sound_speed", "assumed_sound_speed", "range_std", "clock_offset", "processing_delay",
            "processing_delay_correction", "seed",
        )
    } | {"sampling_time": SLOT_NS / SECOND}
    pings = settings["pings"]
    plan_m = np.repeat([settings["distance"], *settings["distances"]], pings)
    return _measure(ComponentSpec(acoustics, SLOT_NS, parameters), plan_m).reshape(-1, pings)


def _evaluate(settings: Mapping[str, Any], ranges: Floats) -> CalibrationResult:
    """The speed of sound from both methods."""
    known, ranges = ranges[0], ranges[1:]
    assumed, distances, pings = (
        settings[name] for name in ("assumed_sound_speed", "distances", "pings")
    )
    mean, scatter = float(known.mean()), float(known.std(ddof=1))
    speed = assumed * settings["distance"] / mean
    relative = np.hypot(
        scatter / np.sqrt(pings) / mean, settings["distance_std"] / settings["distance"]
    )
    (intercept, slope), (intercept_std, slope_std) = _line(np.repeat(distances, pings), ranges)
    table = pd.DataFrame(
        {
            "distance_m": distances,
            "pings": pings,
            "mean_m": ranges.mean(axis=1),
            "std_m": ranges.std(axis=1, ddof=1),
        }
    ).assign(error_m=lambda t: t["mean_m"] - t["distance_m"])
    return CalibrationResult(
        settings=settings,
        known_distance=SoundSpeed(speed, float(speed * relative)),
        per_ping_m_s=speed * scatter / mean,
        line=SoundSpeed(float(assumed / slope), float(assumed * slope_std / slope**2)),
        intercept_m=float(intercept),
        intercept_std_m=float(intercept_std),
        slope=float(slope),
        slope_std=float(slope_std),
        table=table,
    )


def _line(distance: Floats, ranges: Floats) -> tuple[Floats, Floats]:
    """Intercept and slope of a straight line by least squares, and their standard errors."""
    # imported here: it takes a second
    from statsmodels.regression.linear_model import OLS

    fit = OLS(ranges.ravel(), np.column_stack([np.ones(ranges.size), distance])).fit()
    return fit.params, fit.bse


def _check(settings: Mapping[str, Any]) -> None:
    positive = ("sound_speed", "assumed_sound_speed", "distance")
    for name in (*positive, "range_std", "distance_std"):
        value = settings[name]
        if not (np.isfinite(value) and value >= 0) or (name in positive and value == 0):
            bound = "more than 0" if name in positive else "at least 0"
            raise ConfigurationError(f"calibrate {name}: must be {bound}, got {value!r}")
    distances = np.asarray(settings["distances"], dtype=float)
    if not (np.isfinite(distances) & (distances >= 0)).all() or len(set(distances.tolist())) < 3:
        raise ConfigurationError(
            "calibrate distances: must be three different ones or more, none below 0, got "
            f"{distances.tolist()}"
        )
    if settings["pings"] < 2:
        raise ConfigurationError(f"calibrate pings: must be 2 or more, got {settings['pings']!r}")


def _measure(acoustics: ComponentSpec, distance: Floats) -> Floats:
    """Range of each ping [m] at the true distances [m]; shape (n,)."""
    bench = ComponentSpec(lambda: _Bench(distance), SLOT_NS)
    connections = tuple(
        Connection(f"bench.{prefix}{v.name}", f"acoustics.{prefix}{v.name}")
        for prefix, ports in (("target_", MOTION), ("", BEACON_POSITIONS))
        for v in ports
    )
    system = System(
        {"bench": bench, "acoustics": acoustics}, connections, stop_ns=(len(distance) + 1) * SLOT_NS
    )
    return _ranges(execute(resolve(system)), len(distance))


def _ranges(record: Record, pings: int) -> Floats:
    """Ranges in the order of their pings; ping k = 1, 2, … is at k slots."""
    row, beacon = np.nonzero(np.diff(record.values["acoustics.reception_count"], axis=0))
    epoch_s = cast(Floats, record.values["acoustics.range_epoch"])[row + 1, beacon]
    ping = np.rint(epoch_s * SECOND / SLOT_NS).astype(int) - 1
    ranges = np.full(pings, np.nan)
    ranges[ping] = record.values["acoustics.range"][row + 1, beacon]
    return ranges


class _Bench:
    """A transmitter at the origin (all four beacons together) and a receiver to the north.

    At ping k, at k slots, the receiver is at ``distance[k - 1]``.
    """

    variables: Sequence[Variable] = tuple(
        Variable(prefix + v.name, v.description, "output", v.unit, v.shape)
        for prefix, ports in (("target_", MOTION), ("", BEACON_POSITIONS))
        for v in ports
    )

    def __init__(self, distance: Floats) -> None:
        self._distance = distance

    def initialise(
        self, start_ns: int, parameters: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, ArrayLike]:
        return self._outputs(start_ns)

    def do_step(
        self, time_ns: int, step_ns: int, inputs: Mapping[str, NDArray[Any]]
    ) -> Mapping[str, ArrayLike]:
        return self._outputs(time_ns + step_ns)

    def _outputs(self, time_ns: int) -> Mapping[str, ArrayLike]:
        ping = min(max(time_ns // SLOT_NS - 1, 0), len(self._distance) - 1)
        nowhere = np.zeros((BEACONS, 3))
        return {
            "target_position": (self._distance[ping], 0.0, 0.0),
            "target_velocity": (0.0, 0.0, 0.0),
            "beacon_position": nowhere,
            "reported_beacon_position": nowhere,
        }
