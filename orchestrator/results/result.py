"""Result of a run: tables, statistics, figures, and a folder with all of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd
from sblcosim.fmus import files
from sblcosim.models.settings.assumptions import has_clock

from .. import artifacts, style
from ..answer import Answer
from ..catalogue import Figure, Job, by_name, jobs
from ..data.description import RunDescription
from ..data.record import frame_of
from ..data.truth import of_record
from ..errors import ConfigurationError
from ..judge import metrics, possible
from ..judge.columns import TABLES
from ..judge.consistency import NEES_COLUMNS, Verdict, of_runs
from ..judge.without_truth import unknown_bearings
from ..lazy import Module
from ..paths import folder as path_files
from ..paths.diver_path import DiverPath, of_estimates, of_truth
from ..scenario.labels import FIXES, RAW
from ..shown import Picture
from ..web import page, playback
from . import more, notebook, text
from .figures.artist import drawing
from .motion import Motion, motions, too_lively

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    from ..data.estimates import Estimates, Integers
    from ..data.record import Record
    from ..data.truth import Truth
    from ..judge.definitions import Judged
    from ..limits.verdict import Limits, Possible
    from .figures.artist import Artist

plots = Module("sblcosim.results.figures.run")
animation: Any = Module("sblcosim.results.figures.animation")
MADE = "estimates-"
"""Prefix of the names of files with estimates that were made after the run."""

FIGURES: Mapping[str, Figure[Result]] = by_name(
    Figure("path_xy", plots.later("plot_path"), lambda run: (run.record, run.tracks)),
    Figure("path_xyz", plots.later("plot_path_3d"), lambda run: (run.record, run.tracks)),
    Figure("axes", plots.later("plot_axes"), lambda run: (run.record, run.tracks)),
    Figure("errors", plots.later("plot_errors"),
           lambda run: (run.record, run.tracks, None, "absolute", run.limits)),
    Figure("inclination", plots.later("plot_inclination"), lambda run: (run.record,),
           condition=lambda run: metrics.inclines(run.record)),
    *more.rows("FIGURES"),
)
"""The figures in the folder of a run."""


class Result(Answer):
    """A finished run.

    Parameters
    ----------
    description
        Metadata of the run.
    record
        All recorded outputs.
    update_interval_ns
        Update interval of the receivers [ns]; without it, ``update_share`` in `summary` is NaN.
    failures
        Messages of receivers that failed, by label. Those without a record failed before the end,
        and are not in `receivers`. The others failed after it.
    made
        Estimates that were made after the run, by label.
    judged
        The estimates with the truth, if they have been compared already.

    Attributes
    ----------
    record
        All recorded outputs, as arrays (see `Record`); `table` is the DataFrame.
    receivers
        Labels of the receivers that have estimates, the main one first.

    Examples
    --------
    >>> result = sblcosim.run("paper-scenario-1")            # doctest: +SKIP
    >>> result.errors.rms_m["ekf", "absolute", "total"]  # doctest: +SKIP
    >>> result.estimates.groupby("receiver").error_total_m.max()  # doctest: +SKIP
    >>> result.plot_path().figure.savefig("path.png")        # doctest: +SKIP
    """

    document = "run"
    columns = TABLES

    def __init__(
        self,
        description: RunDescription,
        record: Record,
        update_interval_ns: int | None = None,
        failures: Mapping[str, str] | None = None,
        *,
        made: Mapping[str, Estimates] | None = None,
        judged: Mapping[str, Judged] | None = None,
    ) -> None:
        self.description = description
        self.record: Record = record
        self.failures = dict(failures or {})
        self.made = dict(made or {})
        self.receivers = tuple(
            name
            for name in description.receivers
            if name not in self.failures
            or name in self.made
            or f"{name}.update_count" in record.values
        )
        self.update_interval_ns = update_interval_ns
        self._compared = dict(judged or {})

    @property
    def scenario_name(self) -> str:
        """Name of the scenario."""
        return self.description.scenario_name

    @property
    def scenario(self) -> Any:
        """The scenario as run."""
        return self.description.scenario

    @property
    def fmus(self) -> Mapping[str, Any]:
        """SHA-256 of each component's FMU."""
        return self.description.fmus

    @property
    def seeds(self) -> Mapping[str, int]:
        """Seeds by component."""
        return self.description.seeds

    @property
    def origins(self) -> Mapping[str, Mapping[str, Any]]:
        """Origin of each receiver."""
        return self.description.origins

    @property
    def remarks(self) -> Sequence[str]:
        """Remarks on the run, as sentences."""
        path = None if self.limits is None else self.limits.acceleration_psd
        own = () if path is None else too_lively(self.motion, self.origins, path)
        judged = {name: it.estimates for name, it in self.judged.items()}
        return [*self.description.remarks, *own, *unknown_bearings(judged)]

    @cached_property
    def motion(self) -> dict[str, Motion]:
        """What receivers assumed or learned about the diver's motion."""
        return motions(self.origins, self.record, self.receivers)

    @cached_property
    def table(self) -> pd.DataFrame:
        """The record as a DataFrame, one row per communication instant (see `Record.to_frame`)."""
        return self.record.to_frame()

    @cached_property
    def truth(self) -> Truth:
        """The true motion."""
        return of_record(self.record)

    @cached_property
    def judged(self) -> dict[str, Judged]:
        """Estimates of each receiver with the truth, as arrays."""
        rest = [name for name in self.receivers if name not in self._compared]
        judged = self._compared | {
            name: metrics.intact(name, self._given(name), self.truth) for name in rest
        }
        return {name: judged[name] for name in self.receivers}

    def _given(self, receiver: str) -> Estimates:
        made = self.made.get(receiver)
        return self.record.estimates(receiver) if made is None else made

    @cached_property
    def tracks(self) -> dict[str, pd.DataFrame]:
        """Estimates of each receiver, with the truth, as a table for each (see `metrics.track`)."""
        return {receiver: metrics.track(judged) for receiver, judged in self.judged.items()}

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """Estimates of all receivers, with the truth: a row for each, as in ``estimates.csv``.

        The columns are ``receiver`` and those of `tracks`; NaN where a receiver lacks one.
        """
        each = [table.assign(receiver=name) for name, table in self.tracks.items()]
        if not each:
            return pd.DataFrame({"receiver": pd.Series(dtype=str)})
        estimates = pd.concat(each, ignore_index=True)
        estimates.insert(0, "receiver", estimates.pop("receiver"))
        return estimates

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Mean, RMS and standard deviation of the errors [m] (see `metrics.error_table`)."""
        return metrics.error_table(self.tracks)

    @cached_property
    def percentiles(self) -> pd.DataFrame:
        """Order statistics of the errors [m], including CEP50 and R95.

        See `metrics.percentile_table`.
        """
        return metrics.percentile_table(self.tracks)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Availability, NEES, NIS and flags of each receiver (see `metrics.summary`).

        A receiver that failed has a row too. In that case a column ``failure`` holds the messages.
        """
        if not self.failures:
            return self._judged
        missing = [name for name in self.failures if name not in self.receivers]
        table = self._judged.astype(object).reindex([*self.receivers, *missing]).infer_objects()
        return table.assign(failure=table.index.map(self.failures)).rename_axis("receiver")

    @cached_property
    def _judged(self) -> pd.DataFrame:
        """`summary` of the receivers that reached the end."""
        return metrics.summary(
            self.judged, self.tracks, self.truth, self.record, self.update_interval_ns
        )

    @cached_property
    def consistency(self) -> dict[str, dict[str, Verdict]]:
        """What this one run says about the covariances, by receiver and frame.

        See `sblcosim.judge.consistency`. A study of several runs says more.
        """
        nees = {name: self._judged[column].astype(float) for name, column in NEES_COLUMNS.items()}
        return {
            receiver: {
                frame: of_runs(values[[receiver]], float(bool(self.summary.loc[receiver, "lost"])))
                for frame, values in nees.items()
                if values[[receiver]].notna().all()
            }
            for receiver in self.receivers
        }

    @cached_property
    def limits(self) -> Limits | None:
        """What was possible in this run; None if components other than receivers are not ours."""
        return possible.limits_of(self.description, self.record, self._epochs_ns())

    @cached_property
    def verdicts(self) -> dict[str, Possible]:
        """What was possible at the epochs of each receiver's estimates; empty without `limits`.

        A receiver that looks back, such as a smoother, is left out: it uses later measurements.
        """
        epochs = self._epochs_ns()
        told = [r for r in self.receivers if not self.origins.get(r, {}).get("looks_back")]
        return possible.verdicts(self.limits, {name: epochs[name] for name in told})

    def _epochs_ns(self) -> dict[str, Integers]:
        return {name: self._given(name).epoch_ns for name in self.receivers}

    @property
    def problems(self) -> list[str]:
        """A line for each receiver that failed or has no estimate, except the raw fix."""
        return [*self.failures.values()] + [
            f"{receiver}: must give at least one estimate, got none; {text.silence(self, receiver)}"
            for receiver in self.receivers
            if receiver != RAW and self.tracks[receiver].empty
        ]

    @property
    def title(self) -> str:
        """Title of the scenario, or its name."""
        return getattr(self.scenario, "title", "") or self.scenario_name

    def plot_path(self, ax: Axes | None = None, theme: style.ThemeName = "light") -> Picture:
        """Map of the path and the estimates; see `sblcosim.results.figures.run.plot_path`."""
        return Picture(plots.plot_path(self.record, self.tracks, ax, theme), ax)

    def plot_path_3d(self, ax: Axes3D | None = None, theme: style.ThemeName = "light") -> Picture:
        """Path and estimates in space; see `sblcosim.results.figures.run.plot_path_3d`."""
        return Picture(plots.plot_path_3d(self.record, self.tracks, ax, theme), ax)

    def plot_axes(
        self, axes: Sequence[Axes] | None = None, theme: style.ThemeName = "light"
    ) -> Picture:
        """Coordinates over time, three axes; see `sblcosim.results.figures.run.plot_axes`."""
        return Picture(plots.plot_axes(self.record, self.tracks, axes, theme), axes)

    def plot_errors(
        self,
        axes: Sequence[Axes] | None = None,
        frame: str = "absolute",
        theme: style.ThemeName = "light",
    ) -> Picture:
        """Errors over time with ±2σ, four axes; see `sblcosim.results.figures.run.plot_errors`."""
        drawn = plots.plot_errors(self.record, self.tracks, axes, frame, self.limits, theme)
        return Picture(drawn, axes)

    def plot_inclination(
        self, axes: Sequence[Axes] | None = None, theme: style.ThemeName = "light"
    ) -> Picture:
        """Angles of the platform; see `sblcosim.results.figures.run.plot_inclination`."""
        return Picture(plots.plot_inclination(self.record, axes, theme=theme), axes)

    def to_xarray(self) -> xr.Dataset:
        """Everything in one Dataset, with units; see `sblcosim.results.dataset.dataset`."""
        from .dataset import dataset

        return dataset(self.description, self.record, self.tracks)

    @property
    def answer(self) -> str:
        """A verdict for each receiver, one line each."""
        return "\n".join(text.verdicts(self))

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All parts of a run: the record, the estimates, and their evaluation."""
        made = {f"{MADE}{name}": frame_of(it.columns()) for name, it in self.made.items()}
        return {
            "record": self.table, "estimates": self.estimates, **made,
            "errors": self.errors.reset_index(), "percentiles": self.percentiles.reset_index(),
            "summary": self.summary.reset_index(),
        }

    @property
    def figures(self) -> list[Job]:
        """The figures that this run has."""
        return jobs(FIGURES, self)

    def save(
        self,
        directory: str | Path,
        *,
        figures: bool = True,
        theme: style.ThemeName = "light",
        other: artifacts.Other = "refuse",
        artist: Artist | None = None,
        animate: bool = False,
        replay: bool = False,
        log: bool = False,
        trajectories: str | Collection[str] = (),
    ) -> Path:
        """Like `Answer.save`, with the scenario and, if it has a place on Earth, the paths there.

        Figures, animation, replay, log and trajectories of an equal run in the folder are kept.

        Parameters
        ----------
        artist
            Process that draws the figures meanwhile; see
            `sblcosim.results.figures.artist.forked_artist`.
        animate
            Whether to add an animation: ``animation.mp4`` if ffmpeg is available, otherwise
            ``animation.gif``.
        replay
            Whether to add a page that plays the run back, ``replay.html``; see `replay`.
        log
            Whether to add the log of the dive in the folder ``log``: what was received and
            measured, the true track, and the settings. `sblcosim.process` makes the same estimates
            of it, to the last bit.
        trajectories
            Files of the paths to add, some of ``"tum"`` and ``"mcap"``; see
            `sblcosim.paths.folder.write`.

        Raises
        ------
        ConfigurationError
            As `Answer.save`; or a log is asked for of a run that is not of a scenario.
        """
        style.named(theme)
        wanted = path_files.check(trajectories)
        with artifacts.draft(directory, self.manifest(), other, adds=True) as draft:
            drawn = self.figures if figures else []
            with drawing(drawn, draft.folder, theme, artist):
                self._write_tables(draft.folder, directory)
                self._write_paths(draft.folder, wanted)
            if animate:
                file = draft.folder / f"{animation.NAME}{animation.kind_of()}"
                animation.write(self.record, self.tracks, file, theme)
            if replay:
                page.write(self._played(directory), draft.folder / page.NAME)
            if log:
                self._write_log(draft.folder / "log", Path(directory) / "log")
        return draft.saved

    def _write_log(self, folder: Path, place: Path) -> None:
        """Write the log of the dive.

        Parameters
        ----------
        place
            Where the folder will be in the end.
        """
        # Few runs are wanted as a log.
        from ..logs.columns import KINDS, OF_RANGING, SIGNED
        from ..logs.folder import write
        from ..logs.simulated import of_record
        from ..scenario.tracks import origin_of

        scenario = self.description.asked or self.scenario
        if not hasattr(scenario, "dump_toml"):
            raise ConfigurationError(
                f"log: must be of a run of a scenario, got one of {self.scenario_name!r}"
            )
        ours, a = scenario.acoustics.fmu is None, scenario.acoustics
        kind = (OF_RANGING[a.ranging] if has_clock(a) else SIGNED) if ours else KINDS[0]
        told = of_record(
            self.record, name=self.scenario_name, title=self.title,
            sound_speed=scenario.acoustics.assumed_sound_speed_m_s,
            origin=origin_of(scenario.place), kind=kind,
        )
        with artifacts.folder(folder, {"log": told.name, "scenario": self.manifest()}) as part:
            write(told, part)
            settings = scenario.dump_toml(place, everything=False)
            (part / "scenario.toml").write_text(settings, "utf-8")

    def animate(self, file: str | Path, theme: style.ThemeName = "light") -> Path:
        """Write the run as it happened, in about ten seconds: the map and the errors.

        Parameters
        ----------
        file
            The file to write, ``.gif`` or ``.mp4``; MP4 requires ffmpeg. It appears when it is
            complete.

        Raises
        ------
        ConfigurationError
            The file cannot be written, or there is no such theme.
        """
        target = Path(file)
        animation.kind_of(target)
        try:
            files.make_folder(target.parent)  # refused before anything is drawn
            with TemporaryDirectory() as folder:
                made = Path(folder, target.name)
                animation.write(self.record, self.tracks, made, theme)
                files.write_file(target, made.read_bytes())
        except OSError as error:
            raise ConfigurationError(
                f"animate: must be a file that can be written, got {file} ({error.strerror})"
            ) from error
        return target

    def _played(self, place: str | Path) -> playback.Playback:
        """What a page plays back that will be in a folder."""
        seeds = {*self.seeds.values()}
        each = ", ".join(f"{component} {seed}" for component, seed in self.seeds.items())
        told = f"seed {seeds.pop()}" if len(seeds) == 1 else f"seeds {each}" if seeds else ""
        return playback.of_record(
            self.record, self.judged, title=self.title, verdict=self.answer.splitlines(),
            run=", ".join(filter(None, [self.scenario_name, told])),
            scenario=self._scenario_file(place) if hasattr(self.scenario, "dump_toml") else "",
        )

    def replay(self, file: str | Path) -> Path:
        """Write the run as one HTML file that plays it back, without a network.

        It shows the map, from above or in space, and the errors over time with what receivers
        claim. Lengths are rounded to millimetres. Of more than `sblcosim.web.playback.MOST`
        instants or estimates of a receiver, it holds some, and says how many.

        Parameters
        ----------
        file
            The file to write, ``.html``. It appears when it is complete.

        Raises
        ------
        ConfigurationError
            The file cannot be written, or the run has no receivers.
        """
        return page.write(self._played(Path(file).parent), file)

    def _write_tables(self, folder: Path, directory: str | Path) -> None:
        for name, table in self.tables.items():
            artifacts.write_table(table, folder, name)
        if hasattr(self.scenario, "dump_toml"):
            (folder / "scenario.toml").write_text(self._scenario_file(directory), "utf-8")

    @property
    def paths(self) -> list[DiverPath]:
        """The true path, and that of each receiver."""
        estimated = [
            of_estimates(name, judged.estimates, "fix" if name in FIXES else "filter")
            for name, judged in self.judged.items()
        ]
        return [of_truth(self.truth), *estimated]

    def _write_paths(self, folder: Path, trajectories: Collection[str]) -> None:
        # Few runs have a place on Earth.
        place = getattr(self.scenario, "place", None)
        origin = None
        if place is not None:
            from ..scenario.tracks import origin_of

            origin = origin_of(place)
        if origin is not None or trajectories:
            path_files.write(folder, self.title, self.paths, origin, trajectories=trajectories)

    def _scenario_file(self, directory: str | Path) -> str:
        file: str = self.scenario.dump_toml(Path(directory))
        python = next(iter(self.origins.values()), {}).get("python")
        if python is None:
            return file
        return f"# The receiver of the run, {python}, was in Python; [receiver] is another.\n{file}"

    def manifest(self) -> dict[str, Any]:
        """What was run, as plain data."""
        about = self.description.manifest()
        return {**about, "failures": self.failures} if self.failures else about

    def to_json(self) -> dict[str, Any]:
        """Errors, percentiles and summary as plain data; missing numbers are None."""
        result: dict[str, Any] = artifacts.plain(
            {
                "scenario_name": self.scenario_name,
                "seeds": self.seeds,
                "remarks": self.remarks,
                **({"failures": self.failures} if self.failures else {}),
                "errors": _nested(self.errors),
                "percentiles": _nested(self.percentiles),
                "consistency": {
                    receiver: {frame: verdict.to_json() for frame, verdict in found.items()}
                    for receiver, found in self.consistency.items()
                },
                "summary": self.summary.to_dict(orient="index"),
                "limits": {name: v.to_json() for name, v in self.verdicts.items()},
                "motion": {name: it.to_json() for name, it in self.motion.items()},
            }
        )
        return result

    def text(self, *, verbose: bool = False, width: int | None = None) -> str:
        """The run in words: a verdict for each receiver, then a small table of the errors.

        Parameters
        ----------
        verbose
            Add the errors by axis and all percentages, availability, NEES and NIS of each receiver,
            and explanations of these numbers.
        width
            Columns to fit into; None: sentences are not wrapped.
        """
        return text.of_run(self, verbose, width)

    def _gist(self) -> str:
        return notebook.gist(self)

    def _repr_html_(self) -> str:
        return notebook.page(self)


def _nested(table: pd.DataFrame) -> dict[str, Any]:
    """Rows nested by the names of their index."""
    nested: dict[str, Any] = {}
    for row in table.reset_index().to_dict(orient="records"):
        *outer, last = (row.pop(name) for name in table.index.names)
        inner = nested
        for name in outer:
            inner = inner.setdefault(name, {})
        inner[last] = row
    return nested
