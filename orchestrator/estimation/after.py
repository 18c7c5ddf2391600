"""Smooth a run: from its result or folder to tables and figures, in one call."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from sblcosim.fmus.stopping import interruptible
from sblcosim.models import RECEIVERS

from ..answer import Extended
from ..artifacts import Other, plain
from ..data import samples
from ..data.estimates import Estimates, Floats
from ..data.record import Record
from ..data.samples import Samples
from ..errors import ConfigurationError, ConfigurationWarning, instance, nearest, shortened
from ..layout import fitted
from ..results.motion import LEARNED
from ..results.result import Result
from ..scenario.arrangement import has_own_errors
from ..scenario.overrides import Changes, pairs
from ..scenario.scenario import Scenario, load
from ..scenario.sources import choice_of
from ..scenario.wiring import applied
from ..shown import Picture
from ..words.lists import listed
from . import belief, field, model, outcome, smoother, start
from .folder import read_run
from .smoother import PASSES, Track

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from ..results.figures.artist import Artist
    from ..style import ThemeName

SMOOTHER = "smoother"
"""Label of the smoother in tables and figures."""
COUPLED, LONG_BASELINE = "coupled", "long_baseline"


@dataclass(frozen=True, eq=False, repr=False)
class Smoothed(Extended):
    """A run including the estimates of the smoother.

    Attributes
    ----------
    result
        The run, with ``smoother`` next to its receivers in all tables and figures.
    track
        All states at all epochs, and the convergence of the passes.
    doubts
        What speaks against the track, as parts of a sentence (`sblcosim.estimation.belief`). If
        anything does, the estimates of ``smoother`` are those of the filter that it began with.
    """

    document = "smooth"

    result: Result
    track: Track
    doubts: tuple[str, ...] = ()

    @property
    def believable(self) -> bool:
        """Whether nothing speaks against the track."""
        return not self.doubts

    @property
    def estimates(self) -> pd.DataFrame:
        """Estimates of all receivers and the smoother; see `Result.estimates`.

        ``result.made["smoother"]`` holds those of the smoother as arrays, with their covariances.
        """
        return self.result.estimates

    @property
    def errors(self) -> pd.DataFrame:
        """Statistics of the errors [m]; see `Result.errors`."""
        return self.result.errors

    @property
    def percentiles(self) -> pd.DataFrame:
        """Percentiles of the errors [m]; see `Result.percentiles`."""
        return self.result.percentiles

    @property
    def summary(self) -> pd.DataFrame:
        """NEES and flags; see `Result.summary`."""
        return self.result.summary

    @property
    def main(self) -> Result:
        """The run."""
        return self.result

    @property
    def remarks(self) -> list[str]:
        """Remarks of the run, and the convergence of the passes."""
        return [*self.result.remarks, self._convergence()]

    def plot_path(self, ax: Axes | None = None) -> Picture:
        """Map of the path with all estimates."""
        return self.result.plot_path(ax)

    def to_xarray(self) -> xr.Dataset:
        """Everything in one Dataset; see `Result.to_xarray`."""
        return self.result.to_xarray()

    def save(
        self, directory: str | Path, *, figures: bool = True, theme: ThemeName = "light",
        other: Other = "refuse", artist: Artist | None = None,
        trajectories: str | Collection[str] = (),
    ) -> Path:
        """Write everything into a folder; see `Result.save`."""
        return self.result.save(
            directory, figures=figures, theme=theme, other=other, artist=artist,
            trajectories=trajectories,
        )

    def to_json(self) -> dict[str, Any]:
        """As `Result.to_json`, plus ``steps_m``, ``converged``, ``believable`` and ``doubts``."""
        own = {
            "steps_m": list(self.track.steps_m), "converged": self.track.converged,
            "believable": self.believable, "doubts": list(self.doubts),
        }
        return {**self.result.to_json(), **plain(own)}

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """As `Result.text`, plus the convergence of the passes."""
        told = self.result.text(verbose=verbose, width=width)
        return f"{told}\n\n{fitted(self._convergence(), width)}"

    def _gist(self) -> str:
        return f"{self.result._gist()}; {self._convergence()}"

    def _repr_html_(self) -> str:
        return f"{self.result._repr_html_()}<p>{escape(self._convergence())}</p>"

    def _convergence(self) -> str:
        steps = self.track.steps_m
        passes = f"{len(steps)} pass{'' if len(steps) == 1 else 'es'}"
        moved = f"the last pass moved no position by more than {steps[-1]:.2g} m"
        how = "" if self.believable else f"; not believable, as {listed(self.doubts)}"
        return f"{SMOOTHER}: {passes}, {moved}{how}"


@interruptible
def smooth(
    run: Result | str | Path, overrides: Changes = (), *, passes: int = PASSES,
    range_offset_std_m: float = 0.0, range_scale_std: float = 0.0,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Smoothed:
    """Estimate the track of a finished run from everything received in it.

    The smoother (`sblcosim.estimation.smoother`) uses the model and the parameters of the receiver
    `coupled`, or of `long_baseline` if each beacon has its own errors, as fixed beacons and buoys
    have. It starts from the estimates of that receiver. If it was not in the run, it is run on the
    received data. If the track is not believable (`sblcosim.estimation.belief`), the estimates of
    the receiver are given in its place, and a remark says so.

    Parameters
    ----------
    run
        A result, or its folder.
    overrides
        Keys of ``[receiver]`` to change, for example ``{"receiver.acceleration_psd_m2_s3":
        0.003}``. With ``"learned"``, the smoother learns q of the diver's motion for each stretch,
        beginning with the median of what the receiver learned.
    passes
        Maximum number of Gauss-Newton passes.
    range_offset_std_m, range_scale_std
        Standard deviations of a constant offset of each beacon's ranges [m], and of a scale that
        all ranges share; only for beacons with their own errors. They are estimated.
    before
        Called with what is known of the manifest, before the work.

    Raises
    ------
    ConfigurationError
        There is no such run, it has no samples or too few, or a key does not belong to the
        receiver.
    FmuError
        The receiver cannot be built.

    Examples
    --------
    >>> run = sblcosim.run("realistic-dive", receiver="coupled")             # doctest: +SKIP
    >>> smoothed = sblcosim.smooth(run)                                     # doctest: +SKIP
    >>> smoothed.errors.rms_m["smoother", "absolute", "total"]              # doctest: +SKIP
    """
    if isinstance(passes, bool) or not isinstance(passes, int) or passes < 1:
        raise ConfigurationError(
            f"passes: must be a whole number of at least 1, got {shortened(repr(passes))}"
        )
    unknown = {"range_offset_std_m": range_offset_std_m, "range_scale_std": range_scale_std}
    dive = _dive(run, overrides, unknown)
    if before is not None:
        before(_asked(dive))
    record, label = dive.result.record, start.ran(dive.result.record, dive.receiver)
    if label is None:
        record, label = start.run_receiver(record, dive.p, dive.scenario), dive.receiver
    settled = model.settled(dive.p, label, record)
    track = smoother.smooth(
        settled, dive.samples, dive.trajectory(record, label), passes,
        learns=settled is not dive.p, of=dive.model,
    )
    return _smoothed(dive, track, record.estimates(label), label)


def _asked(dive: Dive) -> dict[str, Any]:
    """What is known of the manifest before the work."""
    origin = outcome.origin_of(dive.p, SMOOTHER, dive.model)
    known = outcome.described(dive.result.description, SMOOTHER, origin).manifest()
    return {key: it for key, it in known.items() if key != "remarks"}


def _smoothed(dive: Dive, track: Track, filtered: Estimates, label: str) -> Smoothed:
    """The run including the track, or the estimates of the filter if it is not believable."""
    doubts = belief.doubts(dive.p, dive.samples, track, filtered)
    learned = {} if dive.p.acceleration_psd >= 0 else {
        LEARNED: {"median": float(np.median(track.psd)), "last": float(track.psd[-1])}
    }
    origin = outcome.origin_of(
        dive.p, SMOOTHER, dive.model, looks_back=True, steps_m=track.steps_m, doubts=doubts,
        **learned,
    )
    estimates = _without_times(filtered) if doubts else dive.estimates(track)
    remarks = [_refusal(doubts, label)] if doubts else []
    beside = outcome.beside(dive.result, SMOOTHER, estimates, origin, remarks)
    return Smoothed(beside, track, doubts)


def _without_times(estimates: Estimates) -> Estimates:
    """Estimates of a receiver as if made after the run."""
    return replace(estimates, available_ns=None, until_ns=None, update_count=None)


def _refusal(doubts: Sequence[str], label: str) -> str:
    return (
        f"{SMOOTHER}: its track is not believable, as {listed(doubts)}; its estimates are those of "
        f"{label!r}"
    )


@dataclass(frozen=True, eq=False)
class Dive:
    """A run with the inputs of an estimator after it.

    Attributes
    ----------
    result
        The run.
    p
        Parameters of the receiver; q may be left to be learned (`model.settled`).
    samples
        What was received.
    scenario
        That of the run, with this receiver.
    """

    result: Result
    p: Any
    samples: Samples
    scenario: Scenario

    @property
    def in_field(self) -> bool:
        """Whether each beacon has its own errors."""
        return self.receiver == LONG_BASELINE

    @property
    def receiver(self) -> str:
        """Name of the receiver."""
        return str(self.scenario.receiver.type)

    @property
    def model(self) -> model.RunModel:
        """The model of the receiver."""
        return field.IN_FIELD if self.in_field else model.ON_PLATFORM

    def trajectory(self, record: Record, label: str) -> Floats:
        """States at the epochs of the samples, from the receiver's estimates; (n, d)."""
        of = field.trajectory if self.in_field else start.trajectory
        return of(record, label, self.p, self.samples)

    def estimates(self, track: Track) -> Estimates:
        """Estimates of a track."""
        of = field.of_states if self.in_field else outcome.of_states
        return of(self.p, self.samples, track.mean, track.covariance)


def _dive(run: Result | str | Path, overrides: Changes, unknown: Mapping[str, float]) -> Dive:
    """A run for the smoother, with the model that its beacons need."""
    result, described = _read(run)
    in_field = has_own_errors(described.platform)
    for name, value in unknown.items():
        if not 0 <= value < np.inf:
            raise ConfigurationError(f"{name}: must be at least 0, got {shortened(repr(value))}")
        if value and not in_field:
            raise ConfigurationError(
                f"{name}: must be 0 for beacons on one platform, got {value!r}; it is for beacons "
                "with errors of their own, as on the bottom or below buoys"
            )
    if not in_field:
        return Dive(*prepared(result, overrides))
    scenario = assumed(described, overrides, LONG_BASELINE)
    known = model.parameters(scenario, _begin(result), field.IN_FIELD.component)
    p = field.with_unknowns(known, *unknown.values())
    body = np.zeros((scenario.beacons, 3))
    return Dive(result, p, samples.of_record(result.record, body, samples.OWN), scenario)


def _read(run: Result | str | Path) -> tuple[Result, Scenario]:
    """A run of a scenario, from its folder if need be."""
    if isinstance(run, str | Path):
        run = read_run(run)
    if not isinstance(run, Result) or not isinstance(run.scenario, Scenario):
        raise ConfigurationError(
            f"run: must be the result of a run, or its folder, got {shortened(instance(run))}"
        )
    return run, run.scenario


def _begin(run: Result) -> Floats:
    """True position at the start, NED [m]."""
    return np.asarray(run.record.values["target.position"][0], float)


def prepared(
    run: Result | str | Path, overrides: Changes = ()
) -> tuple[Result, Any, Samples, Scenario]:
    """A run with the inputs of an estimator after it: parameters, samples, and their scenario.

    The model is that of `coupled`. The parameters may leave q to be learned; see
    `sblcosim.estimation.model.settled`.
    """
    result, described = _read(run)
    scenario = assumed(described, overrides)
    if has_own_errors(scenario.platform):
        warnings.warn(
            f"{scenario.name}: the estimator uses the model of {COUPLED!r}, in which beacons share "
            "their errors, but here each beacon has its own", ConfigurationWarning, stacklevel=3
        )
    record = result.record
    p = model.parameters(scenario, _begin(result))
    return result, p, samples.of_record(record, p.beacon_offset, int(p.pose_source)), scenario


def assumed(scenario: Scenario, overrides: Changes, receiver: str = COUPLED) -> Scenario:
    """The scenario of a run with another receiver, and other values for its keys."""
    batch = list(pairs(overrides))
    known = {"prior", *(v.key for v in RECEIVERS[receiver].of("parameter"))}
    for path, _ in batch:
        if path[0] != "receiver" or len(path) != 2 or path[1] not in known:
            name = ".".join(path)
            raise ConfigurationError(
                f"override {shortened(name)}: must be a key of the receiver {receiver!r}, as the "
                f"run is finished{nearest(name, [f'receiver.{key}' for key in known])}"
            )
    keys = {".".join(path): value for path, value in batch}
    return load(applied(scenario, choice_of(scenario, receiver)), keys.items())
