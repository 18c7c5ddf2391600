"""Carrying out a study: batches of runs, a folder of results that can be resumed, and replay.

The folder holds ``study.json`` (what is run, completely) and ``parts/``: Parquet files, each
complete, with a row per run. A run is known by the hash of its parameters, its seed and its FMUs;
what is in the parts is not run again. When all is there, ``runs.parquet`` is the whole table.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet
from sblcosim.fmus.files import write_file
from sblcosim.models import COMPONENTS

from . import artifacts, lanes, masters, native
from .api import run as run_scenario
from .errors import BuildError, ConfigurationError, FmuError, SblcosimError
from .fmu import Fmu
from .master import initial_outputs
from .plan import TICK_PARAMETERS, Plan, resolve
from .reduction import PORTS, SUMS, TRUTH, responses, sums_of
from .result import Result
from .scenario import Scenario
from .study import Study
from .study import load as load_study
from .system import SECOND, Connection, System
from .wiring import FIXED, RAW, choose

Floats = NDArray[np.float64]
RUNS = "runs.parquet"
STUDY = "study.json"
PARTS = "parts"
FORMAT = 1
BATCH = 2048
"""Runs at a time, as a whole number of replicates: all points of a replicate, or none."""
BATCH_STEPS = 200_000_000
"""The same in communication steps, where runs are long: what a kill can cost."""
_PART = 16  # runs at a time where each runs alone: what a kill can cost
_ALIKE = TICK_PARAMETERS | {c.variant for c in COMPONENTS.values() if c.variant is not None}
"""Parameters that must be equal in runs side by side."""


@dataclass(frozen=True, eq=False)
class Point:
    """A design point, ready to be run with any seed.

    Attributes
    ----------
    number
        From 1.
    values
        Physical values of the factors.
    digest
        Of everything but the seed.
    """

    number: int
    values: tuple[float, ...]
    scenario: Scenario
    system: System
    digest: str

    def run_id(self, seed: int) -> str:
        """What a run of this point is known by."""
        return hashlib.sha256(f"{self.digest} {seed}".encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Group:
    """Points that can run side by side: they differ in parameters only.

    Attributes
    ----------
    places
        Their places among all points.
    plan
        Of the first.
    values
        ``component.parameter`` and its values by point, where they are not all the same.
    """

    places: Mapping[int, int]
    plan: Plan
    values: Mapping[str, Floats]
    in_lanes: bool

    @property
    def steps(self) -> int:
        """Communication steps of a run."""
        return self.plan.count - 1


@dataclass(frozen=True, eq=False)
class Campaign:
    """A study with everything looked up.

    Attributes
    ----------
    receivers
        Labels.
    seeded
        Components that get the run's seed.
    handovers
        For ``prior = "true"``.
    fmus
        SHA-256 by component.
    """

    study: Study
    points: tuple[Point, ...]
    groups: tuple[Group, ...]
    receivers: tuple[str, ...]
    seeded: tuple[str, ...]
    handovers: tuple[Connection, ...]
    fmus: Mapping[str, str]

    @property
    def runs(self) -> int:
        """Number of all runs."""
        return len(self.points) * self.study.replicates

    @property
    def steps(self) -> int:
        """Communication steps of all runs."""
        return self.study.replicates * sum(g.steps * len(g.places) for g in self.groups)

    def definition(self) -> dict[str, Any]:
        """What is run, as plain data; equal for campaigns whose runs are the same."""
        study = self.study.model_dump(exclude={"title", "replicates", "scenario", "fixed"})
        content = {"study": study, "scenario": self.study.base.given(), "fmus": self.fmus}
        plain: dict[str, Any] = artifacts.plain(content)
        return plain


@dataclass(frozen=True)
class _Run:
    place: int
    replicate: int
    seed: int
    run_id: str


def prepare(study: Study, master: str | None = None) -> Campaign:
    """Resolve and check all points.

    Raises
    ------
    ConfigurationError, FmuError
        A point cannot be run; the message names it.
    """
    if master is not None and master not in masters.MASTERS:
        raise ConfigurationError(
            f"master: must be {' or '.join(masters.MASTERS)}, got {master!r}"
        )
    labels = tuple(label for label in choose(study.base, _receivers(study)) if label != RAW)
    made = [_resolved(study, n) for n in range(1, len(study.plan.points) + 1)]
    plans = [plan for _, _, plan in made]
    seeded, handovers = _free(study, made[0][1], labels)
    free = {f"{name}.seed" for name in seeded} | {c.target for c in handovers}
    points = [
        Point(
            number,
            tuple(map(float, values)),
            scenario,
            system,
            _digest(system, plan, free, study.settling_ns),
        )
        for number, (values, (scenario, system, plan)) in enumerate(
            zip(study.plan.points, made, strict=True), 1
        )
    ]
    _check_effects(study, points)
    fmus = {c.name: c.source.sha256 for c in plans[0].components if isinstance(c.source, Fmu)}
    return Campaign(
        study, tuple(points), _groups(points, plans, free, master), labels, seeded, handovers, fmus
    )


def _resolved(study: Study, number: int) -> tuple[Scenario, System, Plan]:
    """A design point, looked up and checked."""
    try:
        scenario = study.base.override(study.overrides(number))
        system = _without_raw(scenario.system(_receivers(study)))
        plan = resolve(system)
        length = plan.stop_ns - plan.start_ns
        if length <= study.settling_ns:
            raise ConfigurationError(
                f"settling_time_s: must be less than the length of the run ({length / SECOND:g} "
                f"s), got {study.settling_time_s}"
            )
    except SblcosimError as error:
        values = zip(study.factors, study.plan.points[number - 1], strict=True)
        at = ", ".join(f"{name} = {value:g}" for name, value in values)
        lines = [f"{study.name}: point {number} ({at}): {s}" for s in str(error).splitlines()]
        raise type(error)("\n".join(lines)) from None
    return scenario, system, plan


def _check_effects(study: Study, points: Iterable[Point]) -> None:
    """Refuse factors that change nothing: their points would be the same runs."""
    first: dict[str, int] = {}
    for point in points:
        if study.plan.centre[point.number - 1]:
            continue
        other = first.setdefault(point.digest, point.number)
        if other != point.number:
            before = study.plan.points[other - 1]
            differ = [
                name
                for name, one, two in zip(
                    study.factors, before, study.plan.points[point.number - 1], strict=True
                )
                if one != two
            ]
            raise ConfigurationError(
                f"{study.name}: [factors.{differ[0]}]: must change something in the runs, got "
                f"nothing between points {other} and {point.number}; is it set by another key?"
            )


def _free(
    study: Study, system: System, labels: Iterable[str]
) -> tuple[tuple[str, ...], tuple[Connection, ...]]:
    """Components that get the run's seed; what is handed over at the start of a run."""
    base = study.base
    seeded = tuple(
        name
        for name in FIXED
        if "seed" in system.components[name].parameters
        and "seed" not in getattr(base, name).model_fields_set
    )
    if not seeded:
        raise ConfigurationError(
            f"{study.name}: seed: must be left to the study in at least one of "
            f"{', '.join(FIXED)}, got a seed of its own in each"
        )
    handovers = tuple(
        Connection("target.position", f"{label}.prior_position")
        for label in labels
        if base.true_prior and "prior_position" in system.components[label].parameters
    )
    return seeded, handovers


def _receivers(study: Study) -> list[str]:
    return list(study.receivers)


def _without_raw(system: System) -> System:
    """The raw fix that runs beside the receivers is not wanted."""
    return replace(
        system,
        components={k: v for k, v in system.components.items() if k != RAW},
        connections=tuple(c for c in system.connections if not c.target.startswith(f"{RAW}.")),
    )


def _digest(system: System, plan: Plan, free: Iterable[str], settling_ns: int) -> str:
    """Hash of all that has a say in the responses, except what is ``free``."""
    content = {
        "components": {
            c.name: {
                "fmu": c.source.sha256 if isinstance(c.source, Fmu) else c.origin,
                "interval_ns": c.interval_ns,
                "parameters": {
                    k: v
                    for k, v in system.components[c.name].parameters.items()
                    if f"{c.name}.{k}" not in free
                },
            }
            for c in plan.components
        },
        "free": sorted(free),
        "connections": sorted(f"{c.source} {c.target}" for c in system.connections),
        "span_ns": [plan.start_ns, plan.stop_ns, settling_ns],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _groups(
    points: Sequence[Point], plans: Sequence[Plan], free: Iterable[str], master: str | None
) -> tuple[Group, ...]:
    alike: dict[Any, list[int]] = {}
    for place, (point, plan) in enumerate(zip(points, plans, strict=True)):
        specs = point.system.components
        key = (
            plan.start_ns,
            plan.stop_ns,
            point.system.connections,
            tuple(
                (
                    name,
                    spec.fmu,
                    spec.interval_ns,
                    tuple(sorted(spec.parameters)),
                    tuple(spec.parameters.get(k) for k in sorted(_ALIKE)),
                )
                for name, spec in specs.items()
            ),
        )
        alike.setdefault(key, []).append(place)
    groups = []
    for places in alike.values():
        plan = plans[places[0]]
        if master is None:
            in_lanes = lanes.foreign(plan) is None and native.available()
        else:
            in_lanes = master == "lanes"
        values = {}
        for name, spec in points[places[0]].system.components.items():
            for parameter in spec.parameters:
                rows = [points[i].system.components[name].parameters[parameter] for i in places]
                if f"{name}.{parameter}" not in free and any(row != rows[0] for row in rows):
                    values[f"{name}.{parameter}"] = np.array(rows, np.float64)
        groups.append(Group({p: i for i, p in enumerate(places)}, plan, values, in_lanes))
    return tuple(groups)


# --- Running -------------------------------------------------------------------------------------


def run(
    study: Study,
    out: str | Path,
    *,
    threads: int | None = None,
    master: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> pd.DataFrame:
    """Do what is missing of a study's runs, and return its table.

    Parameters
    ----------
    out
        Folder of the results; one with runs of the same study is completed.
    threads
        Default: all cores. The table does not depend on it.
    master
        As in `sblcosim.run`; None: lanes where all components are ours.
    progress
        Called with the share of what was missing that is done.

    Returns
    -------
    table
        One row per run, by replicate and point: ``point``, ``replicate``, ``run_order``, the
        factors' physical values, ``seed``, each receiver's `sblcosim.reduction.responses` as
        ``RECEIVER.RESPONSE``, ``error`` (missing if the run went well), ``run_id``.

    Raises
    ------
    ConfigurationError
        The folder is of another study or cannot be written to, or a point cannot be run.
    """
    folder = Path(out).resolve()
    campaign = prepare(study, master)
    _open(folder, campaign)
    done = finished(folder)
    replicates = max(
        1,
        min(
            -(-BATCH // len(campaign.points)),
            BATCH_STEPS * study.replicates // campaign.steps,
        ),
    )
    weight = {p: g.steps for g in campaign.groups for p in g.places}
    batches = (
        [r for r in _batch(campaign, first, replicates) if r.run_id not in done]
        for first in range(1, study.replicates + 1, replicates)
    )
    total = passed = 0
    if progress is not None:
        total = sum(
            weight[r.place]
            for first in range(1, study.replicates + 1, replicates)
            for r in _batch(campaign, first, replicates)
            if r.run_id not in done
        )
    for batch in batches:
        side_by_side = all(g.in_lanes for g in campaign.groups)
        size = max(len(batch), 1) if side_by_side else _PART * (threads or os.cpu_count() or 1)
        for i in range(0, len(batch), size):
            part = batch[i : i + size]
            work = sum(weight[r.place] for r in part)

            def report(share: float, passed: int = passed, work: int = work) -> None:
                if progress is not None:
                    progress((passed + share * work) / total)

            _write(folder, part, _simulated(campaign, part, threads, master, report))
            passed += work
            report(1.0, passed, 0)
    whole = table(folder)
    _save(folder / RUNS, whole)
    if progress is not None:
        progress(1.0)
    return whole[whole["replicate"] <= study.replicates].reset_index(drop=True)


def _batch(campaign: Campaign, first: int, replicates: int) -> list[_Run]:
    """All points of some replicates."""
    study = campaign.study
    runs = []
    for replicate in range(first, min(first + replicates, study.replicates + 1)):
        for place, point in enumerate(campaign.points):
            seed = study.run_seed(point.number, replicate)
            runs.append(_Run(place, replicate, seed, point.run_id(seed)))
    return runs


def _simulated(
    campaign: Campaign,
    runs: Sequence[_Run],
    threads: int | None,
    master: str | None,
    progress: Callable[[float], None],
) -> pd.DataFrame:
    """The table of some runs."""
    sums = np.zeros((len(runs), len(campaign.receivers), len(SUMS)))
    errors: list[str | None] = [None] * len(runs)
    durations = np.zeros(len(runs), np.int64)
    work = sum(_work(campaign, runs))
    passed = 0
    for group in campaign.groups:
        rows = [i for i, run in enumerate(runs) if run.place in group.places]
        if not rows:
            continue
        mine = [runs[i] for i in rows]
        share = group.steps * len(rows)

        def report(part: float, passed: int = passed, share: int = share) -> None:
            progress((passed + part * share) / work)

        made = (
            _side_by_side(campaign, group, mine, threads, report)
            if group.in_lanes
            else _one_by_one(campaign, group, mine, threads, master, report)
        )
        sums[rows] = made[0]
        durations[rows] = group.plan.stop_ns - group.plan.start_ns
        for i, error in zip(rows, made[1], strict=True):
            errors[i] = error
        passed += share
    return _table(campaign, runs, sums, durations, errors)


def _work(campaign: Campaign, runs: Iterable[_Run]) -> Iterable[int]:
    count = {p: g.steps for g in campaign.groups for p in g.places}
    return (count[r.place] for r in runs)


def _side_by_side(
    campaign: Campaign,
    group: Group,
    runs: Sequence[_Run],
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> tuple[Floats, list[str | None]]:
    """Sums, (runs, receivers, sums), and errors."""
    at = [group.places[r.place] for r in runs]
    seeds = np.array([r.seed for r in runs])
    variations: dict[str, Any] = {f"{name}.seed": seeds for name in campaign.seeded}
    variations |= {name: values[at] for name, values in group.values.items()}
    try:
        outcome = lanes.execute(
            group.plan,
            variations,
            handovers=campaign.handovers,
            settling_ns=campaign.study.settling_ns,
            threads=threads,
            progress=progress,
        )
    except BuildError:
        raise
    except FmuError as error:
        if len(runs) == 1:
            return np.zeros((1, len(campaign.receivers), len(SUMS))), [_one_line(error)]
        # One run must not end the others.
        alone = [_side_by_side(campaign, group, [r], 1, None) for r in runs]
        return np.concatenate([a for a, _ in alone]), [e for _, es in alone for e in es]
    sums = np.stack([outcome.sums[label] for label in campaign.receivers], axis=1)
    errors: list[str | None] = [None] * len(runs)
    # The other masters know where a run went wrong, and end it there.
    bad = (sums[:, :, SUMS.index("broken")] > 0).any(axis=1) | ~np.isfinite(sums).all(axis=(1, 2))
    if bad.any():
        rows: list[int] = np.flatnonzero(bad).tolist()
        again = _one_by_one(campaign, group, [runs[i] for i in rows], threads, None, _silent)
        sums[rows] = again[0]
        for i, problem in zip(rows, again[1], strict=True):
            errors[i] = problem
    return sums, errors


def _silent(share: float) -> None:
    pass


def _one_by_one(
    campaign: Campaign,
    group: Group,
    runs: Sequence[_Run],
    threads: int | None,
    master: str | None,
    progress: Callable[[float], None],
) -> tuple[Floats, list[str | None]]:
    """As `_side_by_side`, through records."""
    known = {c.name for c in group.plan.columns}
    ports = [f"{label}.{port}" for label in campaign.receivers for port in PORTS]
    record = [name for name in (*TRUTH, *ports) if name in known]
    for name in (*TRUTH, *(f"{r}.{p}" for r in campaign.receivers for p in _NEEDED)):
        if name not in known:
            raise ConfigurationError(f"{name}: must be an output, to judge the runs by, got none")

    def one(run: _Run) -> tuple[Floats, str | None]:
        try:
            plan = resolve(_system(campaign, campaign.points[run.place], run.seed))
            made = masters.execute(plan, record=record, master=master)
            rows = [sums_of(made, r, campaign.study.settling_ns) for r in campaign.receivers]
        except BuildError:
            raise
        except FmuError as error:
            return np.zeros((len(campaign.receivers), len(SUMS))), _one_line(error)
        return np.array(rows), None

    made = []
    # Python components hold the interpreter's lock, and need not be made for threads.
    alone = master == "python" or native.foreign(group.plan) is not None
    with ThreadPoolExecutor(1 if alone else threads or os.cpu_count() or 1) as pool:
        try:
            for i, result in enumerate(pool.map(one, runs), 1):
                made.append(result)
                progress(i / len(runs))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return np.array([sums for sums, _ in made]), [error for _, error in made]


_NEEDED = ("update_count", "epoch", "position")


def _system(campaign: Campaign, point: Point, seed: int) -> System:
    """The system of a run, with its seed and its true start."""
    specs = dict(point.system.components)
    for name in campaign.seeded:
        specs[name] = replace(specs[name], parameters={**specs[name].parameters, "seed": seed})
    if campaign.handovers:
        start = initial_outputs(specs["target"], ("position",))["position"]
        prior = tuple(float(x) for x in start)
        for connection in campaign.handovers:
            label, _, name = connection.target.partition(".")
            specs[label] = replace(
                specs[label], parameters={**specs[label].parameters, name: prior}
            )
    return replace(point.system, components=specs)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _table(
    campaign: Campaign,
    runs: Sequence[_Run],
    sums: Floats,
    durations: NDArray[np.int64],
    errors: list[str | None],
) -> pd.DataFrame:
    study = campaign.study
    order = {
        replicate: study.plan.run_order(replicate, study.seed)
        for replicate in {r.replicate for r in runs}
    }
    columns: dict[str, Any] = {
        "point": np.array([r.place + 1 for r in runs]),
        "replicate": np.array([r.replicate for r in runs]),
        "run_order": np.array([order[r.replicate][r.place] for r in runs]),
    }
    physical = np.array([campaign.points[r.place].values for r in runs])
    columns |= {name: physical[:, i] for i, name in enumerate(study.factors)}
    columns["seed"] = np.array([r.seed for r in runs])
    for number, label in enumerate(campaign.receivers):
        found = responses(sums[:, number], durations)
        columns |= {f"{label}.{name}": found[name].to_numpy() for name in found}
        problems = np.flatnonzero(found["broken"] | (found["estimates"] == 0))
        for i in problems:
            if found["broken"][i]:
                count = int(sums[i, number, SUMS.index("broken")])
                problem = (
                    f"{label}: estimates must be finite and of a known epoch, got {count} others"
                )
            else:
                problem = f"{label}: must give estimates after the settling time, got none"
            errors[i] = errors[i] or problem
    columns["error"] = pd.array(errors, dtype="str")
    columns["run_id"] = pd.array([r.run_id for r in runs], dtype="str")
    return pd.DataFrame(columns)


def estimate(
    campaign: Campaign, threads: int | None = None, master: str | None = None
) -> float:
    """Seconds that all runs will take, from a small sample; nothing is written."""
    sample = [
        run
        for group in campaign.groups
        for run in _batch(campaign, 1, 1)
        if run.place in [*group.places][: 64 if group.in_lanes else 1]
    ]
    _simulated(campaign, sample[:1], threads, master, _silent)  # libraries are loaded
    started = time.perf_counter()
    _simulated(campaign, sample, threads, master, _silent)
    seconds = time.perf_counter() - started
    return seconds * campaign.steps / sum(_work(campaign, sample))


# --- The folder ----------------------------------------------------------------------------------


def _open(folder: Path, campaign: Campaign) -> None:
    """Make the folder, or see that it is of this study.

    Raises
    ------
    ConfigurationError
        It is of another study, holds something else, or cannot be written to.
    """
    definition = campaign.definition()
    replicates = campaign.study.replicates
    if os.path.lexists(folder) and not folder.is_dir():
        raise ConfigurationError(f"{folder}: must be a folder or not exist yet, got a file")
    if (folder / STUDY).exists():
        before = _read(folder)
        if before["definition"] != definition:
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got those of "
                f"{before['definition']['study']['name']!r} with other "
                f"{_difference(before['definition'], definition)}"
            )
        replicates = max(replicates, before["replicates"])
    elif folder.is_dir():
        for file in sorted(folder.iterdir()):
            raise ConfigurationError(
                f"{folder}: must be empty or hold results of this study, got {file.name!r} in it"
            )
    content = {
        "format": FORMAT,
        "replicates": replicates,
        "title": campaign.study.title,
        "definition": definition,
        "software": artifacts.software(),
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    _write_file(folder / STUDY, text.encode())


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """In which parts two definitions differ."""
    parts = [
        key
        for key in now["study"]
        if before["study"].get(key) != now["study"][key]
    ]
    parts += [key for key in ("scenario", "fmus") if before.get(key) != now[key]]
    return ", ".join(parts).replace("fmus", "FMUs") or "contents"


def _read(folder: Path) -> dict[str, Any]:
    """What a folder says about itself."""
    path = folder / STUDY
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise ConfigurationError(
            f"{folder}: must be a folder of a study's results, got no {STUDY} in it"
        ) from None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path}: must be readable, got {_one_line(error)}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ConfigurationError(f"{path}: must have format {FORMAT}, got another")
    return content


def _parts(folder: Path) -> list[Path]:
    return sorted(p for p in (folder / PARTS).glob("*.parquet") if not p.name.startswith("."))


def _parquet(path: Path, columns: list[str] | None = None) -> pa.Table:
    try:
        return parquet.read_table(path, columns=columns, partitioning=None)
    except (OSError, pa.ArrowInvalid) as error:
        raise ConfigurationError(
            f"{path}: must be a Parquet file that can be read, got {_one_line(error)}; without it "
            "its runs are done again"
        ) from None


def finished(results: str | Path) -> set[str]:
    """Ids of the runs that are in a folder of results."""
    return {
        run_id
        for path in _parts(Path(results))
        for run_id in _parquet(path, ["run_id"])["run_id"].to_pylist()
    }


def table(results: str | Path) -> pd.DataFrame:
    """All runs in a folder of results, by replicate and point, also of an unfinished campaign.

    Raises
    ------
    ConfigurationError
        There are no runs.
    """
    folder = Path(results)
    _read(folder)
    parts = [_parquet(path).to_pandas() for path in _parts(folder)]
    if not parts:
        raise ConfigurationError(f"{folder}: must hold runs, got none yet")
    whole: pd.DataFrame = pd.concat(parts, ignore_index=True).drop_duplicates("run_id")
    return whole.sort_values(["replicate", "point"], ignore_index=True)


def study_of(results: str | Path) -> Study:
    """The study whose results a folder holds."""
    content = _read(Path(results))
    definition = content["definition"]
    tables = {k: v for k, v in definition["study"].items() if v is not None}
    tables["design"] = {k: v for k, v in tables["design"].items() if v is not None}
    return load_study(
        {
            **tables,
            "title": content["title"],
            "replicates": content["replicates"],
            "scenario": definition["scenario"],
        }
    )


def _write(folder: Path, runs: Sequence[_Run], made: pd.DataFrame) -> None:
    """Keep some runs; their part appears when it is complete."""
    ids = hashlib.sha256(" ".join(r.run_id for r in runs).encode()).hexdigest()[:16]
    _save(folder / PARTS / f"{runs[0].replicate:06d}-{ids}.parquet", made)


def _save(path: Path, made: pd.DataFrame) -> None:
    arrow = pa.Table.from_pandas(made, preserve_index=False)
    for name in ("error", "run_id"):
        place = arrow.schema.get_field_index(name)
        arrow = arrow.set_column(place, name, arrow[name].cast(pa.string()))
    stream = pa.BufferOutputStream()
    parquet.write_table(arrow.replace_schema_metadata(None), stream)
    _write_file(path, stream.getvalue().to_pybytes())


def _write_file(path: Path, content: bytes) -> None:
    try:
        write_file(path, content)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: must be writable, got {error.strerror or error}; runs that are finished "
            "are kept"
        ) from None


# --- Replay --------------------------------------------------------------------------------------


def replay(
    results: str | Path,
    run_id: str,
    *,
    master: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Do a run of a study again, and record everything.

    Parameters
    ----------
    results
        Folder of results.
    run_id
        As in the table, or the beginning of it.

    Raises
    ------
    ConfigurationError
        There is no such run, or it cannot be done again: the FMUs have changed.
    """
    study = study_of(results)
    runs = table(results)
    found = runs[runs["run_id"].str.startswith(run_id)] if run_id else runs[:0]
    if len(found) != 1:
        what = f"the beginning of {len(found)}" if len(found) else "none of them"
        raise ConfigurationError(
            f"run: must be the run_id of one run in {results}, got {run_id!r}, which is {what}"
        )
    number, seed, run_id = (found.iloc[0][name] for name in ("point", "seed", "run_id"))
    scenario, system, plan = _resolved(study, int(number))
    labels = [name for name in system.components if name not in FIXED]
    seeded, handovers = _free(study, system, labels)
    free = {f"{name}.seed" for name in seeded} | {c.target for c in handovers}
    digest = _digest(system, plan, free, study.settling_ns)
    if Point(int(number), (), scenario, system, digest).run_id(int(seed)) != run_id:
        raise ConfigurationError(
            f"run {run_id}: must be done again with the FMUs of then, got others"
        )
    return run_scenario(
        scenario.override({"seed": int(seed)}),
        _receivers(study),
        master=master,
        progress=progress,
    )


__all__ = [
    "Campaign", "estimate", "finished", "prepare", "replay", "run", "study_of", "table",
]
