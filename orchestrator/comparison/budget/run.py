"""The sources of an error: each switched off alone, and on alone, with the same noise.

>>> sblcosim.budget("realistic-dive")                                # doctest: +SKIP
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sblcosim.fmus.stopping import interruptible
from sblcosim.models import RECEIVERS
from sblcosim.models.settings.assumptions import SOURCES as ASSUMED
from sblcosim.models.settings.keys import default

from ... import artifacts
from ...errors import ConfigurationError, NoEffectWarning, instance, shortened
from ...judge.over_runs import rms_over_runs
from ...scenario import scenario as scenarios
from ...scenario.files import naming_files
from ...scenario.overrides import Changes
from ...scenario.scenario import Scenario, Source
from ...scenario.sources import choice_of
from ...simulation.how import How
from ...study import runner, study
from ...study.kept import Kept
from . import sources
from .bound import BOUND_RUNS, BoundBySwitch, bounds
from .result import ALL, FRAMES, NONE, REMAINDER, Budget
from .shares import LEAST_RUNS, shares
from .tables import RowKind

Floats = NDArray[np.float64]
Overrides = Mapping[str, Any]

RUNS = 400
"""Default number of runs with each switch."""
_RMS = "_total_rms_m"
_WITHOUT, _ALONE = "without ", "alone "


@dataclass(frozen=True)
class _Row:
    """A row of the table: its name, its kind, and the sources that it switches."""

    name: str
    kind: RowKind
    sources: tuple[str, ...]


@interruptible
@naming_files
def budget(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    receiver: Source | None = None,
    overrides: Changes = (),
    *,
    better: bool = False,
    together: Sequence[str | Sequence[str]] = (),
    untold: bool = False,
    runs: int = RUNS,
    seed: int | None = None,
    acceleration_psd: float | None = None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
    keep: Kept | None = None,
    before: Callable[[Mapping[str, Any]], None] | None = None,
) -> Budget:
    """Find the sources of a receiver's error.

    All runs with the same seed have the same noise, whatever is switched. Shares are parts of the
    mean square of the total error over all runs. A separate row has what does not add up.

    Parameters
    ----------
    scenario
        As in `sblcosim.run`, but no SSP package.
    receiver
        As in `sblcosim.run`, but a single one; None: the scenario's own.
    overrides
        Keys of the scenario to change; see `sblcosim.load`.
    better
        Replace each source with that of better equipment, instead of switching it off.
    together
        Sources to switch together as well: ``"clock+sound speed"``, or sequences of names.
    untold
        Let the receiver keep the assumptions that it has without any switch.
    runs
        Number of runs with each switch, with consecutive seeds; at least 30.
    seed
        Seed of the first run and of the resampling; None: the scenario's.
    acceleration_psd
        q of the bound [m²/s³], the same for all switches. None: the receiver's, if the scenario
        sets it to a number, else that of the path. Cannot be set where the motion is drawn from the
        model.
    workers
        Number of threads; None: all cores.
    progress
        Called with the completed share, 0 to 1.
    keep
        Folder of finished runs, which are not repeated; None: nothing is written.
    before
        Called with what is known of the manifest, before the first run.

    Raises
    ------
    ConfigurationError
        The scenario or an argument is invalid, the scenario has no source of error, or too many
        runs fail.
    """
    base = scenarios.load(scenario, overrides)
    if isinstance(runs, bool) or not isinstance(runs, int) or runs < LEAST_RUNS:
        raise ConfigurationError(
            f"runs: must be a whole number of at least {LEAST_RUNS}, got "
            f"{shortened(instance(runs))}"
        )
    names = sources.of_scenario(base, better)
    if not names:
        what = "that better equipment changes" if better else "to look for"
        raise ConfigurationError(f"{base.name}: must have an error {what}, got none")
    rows = _rows(names, together, sources.missing(base, better))
    switches = _switches(base, names, rows, better)
    seed = base.seed if seed is None else seed
    told = switches
    if untold:
        told = {k: {**v, **_pins(base, receiver, v)} for k, v in switches.items()}

    def done(share: float) -> None:
        if progress is not None:
            progress(0.9 * share)

    chosen = () if receiver is None else (receiver,)
    if before is not None:
        label = next(iter(choice_of(base, chosen).receivers))
        about = {"receiver": label, "runs": runs, "seed": seed, "better": better, "untold": untold}
        asked = [ALL, *(row.name for row in rows), NONE, REMAINDER]
        before({"budget": about | {"rows": asked}, "scenario": artifacts.plain(base.given())})
    def simulated(definition: study.Study, progress: Callable[[float], None]) -> pd.DataFrame:
        return runner.simulated(definition, How(workers=workers, progress=progress), keep)

    label, squares, lost, dropped = _simulated(base, chosen, told, runs, seed, simulated, done)
    if acceleration_psd is None and "acceleration_psd_m2_s3" in base.receiver.model_fields_set:
        given = base.receiver.acceleration_psd_m2_s3
        acceleration_psd = None if isinstance(given, str) else given
    possible = bounds(base, switches, seed, acceleration_psd)
    if progress is not None:
        progress(1.0)
    return Budget(
        scenario=base.name,
        receiver=label,
        table=_table(rows, squares, possible, seed),
        runs=runs - dropped,
        dropped=dropped,
        seed=seed,
        better=better,
        untold=untold,
        lost=lost,
        bound_runs=0 if possible is None else BOUND_RUNS,
        bound_kind="" if possible is None else possible.kind,
        acceleration_psd=None if possible is None else possible.acceleration_psd,
        fixed=sources.fixed(base, names),
        equipment=sources.equipment(base) if better else {},
        unchanged=tuple(n for n in sources.of_scenario(base) if n not in names),
        given=_given(base),
        settings=base.given(),
    )


def _rows(
    names: Sequence[str], together: Sequence[str | Sequence[str]], others: Mapping[str, str]
) -> list[_Row]:
    if isinstance(together, str):
        together = (together,)
    rows = [_Row(name, "source", (name,)) for name in names]
    for asked in together:
        several = sources.combination(asked, names, others)
        if len(several) < 2:
            raise ConfigurationError(
                "together: must be two sources or more, such as clock+sound-speed, got "
                f"{', '.join(several) or 'none'}"
            )
        row = _Row(" + ".join(several), "together", several)
        if row not in rows:
            rows.append(row)
    return rows


def _switches(
    base: Scenario, names: Sequence[str], rows: Sequence[_Row], better: bool
) -> dict[str, Overrides]:
    """Overrides of the scenario, by kind of switch."""
    switches: dict[str, Overrides] = {ALL: {}}
    for row in rows:
        others = [name for name in names if name not in row.sources]
        switches[_WITHOUT + row.name] = sources.switched(base, row.sources, better)
        switches[_ALONE + row.name] = sources.switched(base, others, better)
    switches[NONE] = sources.switched(base, names, better)
    return switches


def _simulated(
    base: Scenario,
    receivers: Sequence[Source],
    switches: Mapping[str, Overrides],
    runs: int,
    seed: int,
    simulated: Callable[..., pd.DataFrame],
    progress: Callable[[float], None],
) -> tuple[str, dict[str, Floats], float, int]:
    """The receiver, squared errors (runs, frames) by switch, share of lost runs, dropped runs."""
    known: dict[str, pd.DataFrame] = {}
    label = ""
    for number, overrides in enumerate(switches.values()):
        key = _key(overrides)
        if key in known:
            continue

        def part(share: float, before: int = number) -> None:
            progress((before + share) / len(switches))

        definition = study.load(
            {
                "name": base.name, "scenario": base.given(), "replicates": runs, "seed": seed,
                "seeding": "common", "design": {"kind": "single"}, "fixed": dict(overrides),
            },
            receivers=receivers,
        )  # fmt: skip
        with warnings.catch_warnings():
            if overrides:  # remarks on the scenario have been made already
                warnings.simplefilter("ignore")
            known[key] = simulated(definition, part)
        if not label:
            column = next(c for c in known[key].columns if c.endswith(f".absolute{_RMS}"))
            label = column.partition(".")[0]
    columns = [f"{label}.{frame}{_RMS}" for frame in FRAMES]
    every = [t[columns].to_numpy(np.float64, na_value=np.nan) for t in known.values()]
    failed = np.any([t["error"].notna().to_numpy() for t in known.values()], axis=0)
    bad = failed | _without_estimate(every, failed)
    if runs - bad.sum() < LEAST_RUNS:
        errors = [e for t in known.values() for e in t["error"].dropna()]
        raise ConfigurationError(
            f"{label}: must do at least {LEAST_RUNS} runs with every switch, got "
            f"{runs - bad.sum()}; e.g. {errors[0] if errors else 'a run without an estimate'}"
        )
    found = {
        name: known[_key(overrides)].loc[~bad, columns].to_numpy(np.float64, na_value=np.nan) ** 2
        for name, overrides in switches.items()
    }
    lost = known[_key({})].loc[~bad, f"{label}.lost"].to_numpy(np.float64, na_value=np.nan)
    return label, found, float(np.nanmean(lost)), int(bad.sum())


def _without_estimate(every: Sequence[Floats], failed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Seeds with a run that has no error, by frame; a switch that never gives errors is ignored.

    Parameters
    ----------
    every
        Errors with each switch, beginning without any; (runs, frames).
    failed
        Seeds that are left out anyway.
    """
    missing = np.isnan(np.stack(every))
    never: NDArray[np.bool_] = np.all(missing[:, ~failed], axis=1)
    never = never | never[0]  # the receiver has no such error
    found: NDArray[np.bool_] = np.any(missing & ~never[:, None], axis=(0, 2))
    return found


def _key(overrides: Overrides) -> str:
    return repr(sorted(overrides.items()))


def _table(
    rows: Sequence[_Row], squares: Mapping[str, Floats], possible: BoundBySwitch | None, seed: int
) -> pd.DataFrame:
    found = []
    for number, frame in enumerate(FRAMES):
        of_frame = {name: values[:, number] for name, values in squares.items()}
        if np.isnan(of_frame[ALL]).any():
            continue  # the receiver has no such error
        limit = None if possible is None else possible.squares[frame]
        lines = [*_lines(rows, of_frame, seed)]
        beside = [None] * len(lines) if limit is None else [
            *_lines(rows, {name: np.array([v]) for name, v in limit.items()}, None)
        ]
        for line, bound in zip(lines, beside, strict=True):
            kept = ("rms_m", "share", "alone_rms_m", "alone_share")
            found.append(
                {"frame": frame, **line}
                | {f"bound_{k}": np.nan if bound is None else bound[k] for k in kept}
            )
    return pd.DataFrame(found)


def _lines(
    rows: Sequence[_Row], squares: Mapping[str, Floats], seed: int | None
) -> Iterator[dict[str, Any]]:
    """The table of one frame; without a seed there are no intervals."""
    whole, rest = squares[ALL], squares[NONE]
    parts: list[tuple[Floats, Floats]] = [
        (whole - squares[_WITHOUT + row.name], squares[_ALONE + row.name] - rest) for row in rows
    ]
    own = [part for row, part in zip(rows, parts, strict=True) if row.kind == "source"]
    parts += [(rest, rest)]
    parts += [(whole - rest - sum(p[0] for p in own), whole - rest - sum(p[1] for p in own))]
    flat = np.column_stack([part for pair in parts for part in pair])
    if seed is None:
        ratio = flat.mean(axis=0) / whole.mean()
        low = high = np.full_like(ratio, np.nan)
    else:
        ratio, low, high = shares(flat, whole, seed)
    ends = (_Row(NONE, "rest", ()), _Row(REMAINDER, "remainder", ()))
    yield {"source": ALL, "kind": "all", "rms_m": rms_over_runs(whole), **_interval(), **_alone()}
    for i, row in enumerate((*rows, *ends)):
        off, on = ((ratio[k], low[k], high[k]) for k in (2 * i, 2 * i + 1))
        without = NONE if row.kind == "rest" else _WITHOUT + row.name
        alone = NONE if row.kind == "rest" else _ALONE + row.name
        yield {
            "source": row.name,
            "kind": row.kind,
            "rms_m": rms_over_runs(squares[without]) if without in squares else np.nan,
            **_interval(*off),
            **_alone(rms_over_runs(squares[alone]) if alone in squares else np.nan, *on),
        }


def _interval(
    share: float = np.nan, low: float = np.nan, high: float = np.nan
) -> dict[str, float]:
    return {"share": share, "share_low": low, "share_high": high}


def _alone(
    rms: float = np.nan, share: float = np.nan, low: float = np.nan, high: float = np.nan
) -> dict[str, float]:
    return {"alone_rms_m": rms, "alone_share": share, "alone_low": low, "alone_high": high}


def _given(base: Scenario) -> tuple[str, ...]:
    """What a receiver would assume after each switch if the scenario did not set it."""
    return tuple(sorted(ASSUMED.keys() & base.receiver.model_fields_set))


def _pins(base: Scenario, receiver: Source | None, overrides: Overrides) -> dict[str, Any]:
    """Keys of the receiver that a switch would change, with their values before it."""
    name = receiver or base.receiver.type
    if not isinstance(name, str) or name not in RECEIVERS:
        raise ConfigurationError(
            f"untold: must come with one of {', '.join(RECEIVERS)}, got "
            f"{shortened(instance(receiver or base.receiver.fmu))}"
        )
    component = RECEIVERS[name]
    own = {v.key: v for v in component.of("parameter")}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NoEffectWarning)
        after = scenarios.load(base.given(), overrides.items())
    told, known = (s.assumptions([v.name for v in own.values()]) for s in (after, base))
    return {
        f"receiver.{key}": known.get(key, default(component, own[key]))
        for key in own.keys() & (told.keys() | known.keys()) - base.receiver.model_fields_set
        if told.get(key) != known.get(key)
    }

