"""Results as the documents that commands print, and the texts about a study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import studies as study_documents

if TYPE_CHECKING:
    import pandas as pd

    from ...simulation.plans.plan import Plan
    from ...study.parts import Parts
    from ...study.study import Study as Definition
    from . import by_command as documents

_CHANCE = 0.05
"""Share of the points at which a right covariance leaves its band."""


def plan(plan: Plan) -> documents.Plan:
    """What would run."""
    from sblcosim.fmus.read.ports import Fmu

    from . import by_command as documents

    return documents.Plan.of(
        {
            "start_s": plan.start_ns / 1e9,
            "stop_s": plan.stop_ns / 1e9,
            "instants": plan.count,
            "components": [
                {
                    "name": c.name,
                    "origin": c.origin,
                    "fmi": c.source.fmi if isinstance(c.source, Fmu) else None,
                    "sha256": c.file_sha256,
                    "interval_s": c.interval_ns / 1e9,
                    "tick_s": None if c.tick_ns is None else c.tick_ns / 1e9,
                }
                for c in plan.components
            ],
            "parameters": [
                {
                    "name": f"{c.name}.{s.port.name}",
                    "type": s.port.type,
                    "unit": s.port.unit,
                    "references": s.port.references,
                    "values": s.values,
                }
                for c in plan.components
                for s in c.settings
            ],
            "connections": [
                {"source": connection.source, "target": connection.target}
                for c in plan.components
                for w in c.writes
                for connection in w.connections
            ],
            "recorded": [
                {"name": c.name, "type": c.type, "shape": c.shape} for c in plan.columns
            ],
        }
    )


def study(definition: Definition, out: Path, **known: Any) -> study_documents.Study:
    """A study, before or after its runs; `known` are further fields."""
    points = len(definition.points.values)
    blank: dict[str, Any] = {
        "finished": 0, "failed": 0, "failure": None, "receivers": {}, "estimate": None,
    }  # fmt: skip
    return study_documents.Study.of(
        {
            "folder": str(out),
            "points": points,
            "replicates": definition.replicates,
            "runs": points * definition.replicates,
            **blank,
            **known,
        }
    )


def carried_out(definition: Definition, out: Path, there: Parts) -> study_documents.Study:
    """A study that was run in a folder; `there` is what was found in the folder."""
    from ...study import parts

    runs = parts.table(there, _needed)
    runs = runs[runs["replicate"] <= definition.replicates]
    failed = runs["error"].dropna()
    failure = None
    if len(failed):
        ids = parts.table(there, lambda names: ["run_id"])["run_id"]
        failure = f"{ids[failed.index[0]]}: {failed.iloc[0]}"
    return study(
        definition,
        out,
        finished=len(runs),
        failed=len(failed),
        failure=failure,
        receivers=_receivers(runs),
    )


def _needed(names: Sequence[str]) -> list[str]:
    """The columns of the table of runs that are read."""
    from ...judge.consistency import NEES_COLUMNS

    own = ("point", "replicate", "error")
    responses = (
        *NEES_COLUMNS.values(), "absolute_total_rms_m", "inconsistent", "lost", "misleading",
    )  # fmt: skip
    return [name for name in names if name in own or name.partition(".")[2] in responses]


def _receivers(runs: pd.DataFrame) -> dict[str, Any]:
    from ...analysis import covariance
    from ...judge.over_runs import pooled

    verdicts = covariance.by_point(runs)
    words = covariance.sentences(verdicts)
    found: dict[str, Any] = {}
    suffix = ".absolute_total_rms_m"
    for column in runs.columns[runs.columns.str.endswith(suffix)]:
        name = column.removesuffix(suffix)
        if runs[column].isna().all():
            continue
        found[name] = {
            "rms_m": pooled(runs[column].to_numpy(float, na_value=nan)),
            "inconsistent": runs[f"{name}.inconsistent"].astype("Float64").mean(),
            "lost": runs[f"{name}.lost"].astype("Float64").mean(),
            "misleading": _mean(runs, f"{name}.misleading"),
            "covariances": {},
        }
    said = {name: iter(sentences) for name, sentences in words.items()}
    for row in covariance.summary(verdicts).to_dict(orient="records"):
        receiver, frame = row.pop("receiver"), row.pop("frame")
        sentence = next(said[receiver])
        if receiver in found:
            found[receiver]["covariances"][frame] = {**row, "words": sentence}
    return found


def _mean(runs: pd.DataFrame, column: str) -> Any:
    """Mean of a column, which runs of an earlier version lack."""
    return runs[column].astype("Float64").mean() if column in runs else nan


def study_lines(study: study_documents.Study, verbose: bool) -> Iterator[str]:
    """A verdict for each receiver, then the number of runs.

    Parameters
    ----------
    verbose
        Add the remarks on each covariance, and the share of inconsistent runs.
    """
    from ...words.numbers import meters
    from ...words.shares import percent, rough_percent

    for name, receiver in study.receivers.items():
        lost = f", {percent(receiver.lost, '.0f')} lost" if receiver.lost else ""
        if receiver.misleading:
            lost += f", {rough_percent(receiver.misleading)} misleading"
        rms = "–" if receiver.rms_m is None else meters(receiver.rms_m)
        yield f"{name}: {rms} RMS over all runs{lost}; {_trust(receiver)}"
        if verbose:
            if receiver.inconsistent is not None:
                yield f"  {percent(receiver.inconsistent, '.0f')} of its runs inconsistent"
            for covariance in receiver.covariances.values():
                yield f"  {covariance.words}"
    if verbose or any(receiver.lost for receiver in study.receivers.values()):
        from ...judge.definitions import LOST

        yield LOST
    if verbose or any(receiver.misleading for receiver in study.receivers.values()):
        from ...judge.definitions import MISLEADING

        yield MISLEADING
    yield f"{study.finished} runs, {study.failed} failed"
    if study.failure is not None:
        yield f"  e.g. {study.failure}"


def _trust(receiver: study_documents.StudyReceiver) -> str:
    """Whether to believe a receiver's absolute covariance."""
    found = receiver.covariances.get("absolute")
    if found is None:
        return "no covariance"
    if found.optimistic > _CHANCE * found.points:
        return f"do not trust its covariance: optimistic{_at(found.optimistic, found)}"
    from ...judge.definitions import MANY_LOST

    if found.untold == found.points and receiver.lost and receiver.lost > MANY_LOST:
        return "its covariance is not judged, because too many runs are lost"
    if found.untold == found.points:
        return "too few runs to tell whether its covariance is right"
    if found.pessimistic > _CHANCE * found.points:
        return f"its covariance is pessimistic{_at(found.pessimistic, found)}"
    return f"its covariance is in band{_at(found.in_band, found)}"


def _at(points: int, found: study_documents.CovarianceOverPoints) -> str:
    return "" if found.points == 1 else f" at {points} of {found.points} points"
