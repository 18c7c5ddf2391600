"""Results as the documents that commands print, and what is said of a study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import studies as study_documents

if TYPE_CHECKING:
    import pandas as pd

    from ...analysis.advice.advice import Advice
    from ...analysis.levels.analysis import GeneralFactorial
    from ...report.means import Means
    from ...report.space import Indices
    from ...report.two_level import Findings
    from ...require.answer import Answer as Requirement
    from ...simulation.plans.plan import Plan
    from ...study.parts import Parts
    from ...study.study import Study as Definition
    from . import by_command as documents
    from .document import DocumentPart

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
    """A study that has been carried out in a folder; `there` is what has been found in it."""
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
    """The columns of the table of runs that are looked at."""
    from ...judge.consistency import NEES_COLUMNS

    own = ("point", "replicate", "error")
    responses = (*NEES_COLUMNS.values(), "absolute_total_rms_m", "inconsistent", "lost")
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
            "covariances": {},
        }
    said = {name: iter(sentences) for name, sentences in words.items()}
    for row in covariance.summary(verdicts).to_dict(orient="records"):
        receiver, frame = row.pop("receiver"), row.pop("frame")
        sentence = next(said[receiver])
        if receiver in found:
            found[receiver]["covariances"][frame] = {**row, "words": sentence}
    return found


def study_lines(study: study_documents.Study, verbose: bool) -> Iterator[str]:
    """A verdict for each receiver, then how many runs there are.

    Parameters
    ----------
    verbose
        With what is said of each covariance, and the share of inconsistent runs.
    """
    from ...words.numbers import meters

    for name, receiver in study.receivers.items():
        lost = f", {receiver.lost:.0%} lost" if receiver.lost else ""
        rms = "–" if receiver.rms_m is None else meters(receiver.rms_m)
        yield f"{name}: {rms} RMS over all runs{lost}; {_trust(receiver)}"
        if verbose:
            if receiver.inconsistent is not None:
                yield f"  {receiver.inconsistent:.0%} of its runs inconsistent"
            for covariance in receiver.covariances.values():
                yield f"  {covariance.words}"
    if verbose or any(receiver.lost for receiver in study.receivers.values()):
        from ...judge.definitions import LOST

        yield LOST
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
    if found.untold == found.points:
        return "too few runs to tell whether its covariance is right"
    if found.pessimistic > _CHANCE * found.points:
        return f"its covariance is pessimistic{_at(found.pessimistic, found)}"
    return f"its covariance is in band{_at(found.in_band, found)}"


def _at(points: int, found: study_documents.CovarianceOverPoints) -> str:
    return "" if found.points == 1 else f" at {points} of {found.points} points"


def analysis(
    found: Findings | Means | GeneralFactorial | Indices, folder: Path, report: Path
) -> study_documents.Analysis:
    """Effects of a two-level design, means of a sweep, levels of a grid, or indices of a space."""
    from ...analysis.levels.analysis import GeneralFactorial
    from ...report.space import Indices
    from ...report.two_level import Findings

    content: dict[str, Any] = {
        "folder": str(folder), "report": str(report), "transform": "none", "method": None,
        "confidence": 0.95, "dropped": 0, "left_out": None, "r2": None, "effects": [],
        "means": [], "levels": [], "medians": [], "pairs": [], "indices": [], "notes": [],
    }  # fmt: skip
    if isinstance(found, GeneralFactorial):
        content |= _of_levels(found)
    elif isinstance(found, Indices):
        content |= _of_space(found)
    elif isinstance(found, Findings):
        from ...analysis.two_level import sentences

        a = found.data
        effects = a.ranked().drop(columns=["coefficient"])
        content |= {
            "response": a.response, "unit": a.unit, "answer": sentences.answer(found.shown),
            "transform": a.transform, "method": a.method, "confidence": a.confidence,
            "runs": a.runs, "dropped": a.dropped, "r2": a.r2,
            "effects": effects.rename_axis("term").reset_index().to_dict(orient="records"),
            "notes": sentences.notes(found.shown),
        }  # fmt: skip
    else:
        content |= {
            "response": found.response, "unit": found.unit, "answer": found.answer,
            "runs": int(found.table["runs"].sum()),
            "means": found.table.to_dict(orient="records"),
        }  # fmt: skip
    return study_documents.Analysis.of(content)


def _of_levels(analysis: GeneralFactorial) -> dict[str, Any]:
    from ...analysis.levels import sentences

    return {
        "response": analysis.response, "unit": analysis.unit,
        "answer": sentences.answer(analysis.readable),
        "transform": analysis.transform, "confidence": analysis.confidence, "runs": analysis.runs,
        "dropped": analysis.dropped, "r2": analysis.r2,
        "levels": _rows(analysis.means, study_documents.LevelMean),
        "medians": _rows(analysis.medians, study_documents.LevelMedian),
        "pairs": _rows(
            analysis.pairs if "verdict" in analysis.pairs else analysis.pairs.assign(verdict=None),
            study_documents.LevelPair,
        ),
        "notes": [*sentences.warnings(analysis.readable), *sentences.notes(analysis.readable)],
    }  # fmt: skip


def _of_space(indices: Indices) -> dict[str, Any]:
    from ...analysis.space import sentences

    main = indices.main
    return {
        "response": main.response, "unit": "", "answer": sentences.answer(main),
        "transform": main.transform, "confidence": main.confidence, "runs": main.runs,
        "dropped": main.dropped, "left_out": main.share_left_out,
        "indices": [
            row for one in indices.of
            for row in _rows(one.indices.reset_index().assign(response=one.response),
                             study_documents.SobolIndex)
        ],
        "notes": sentences.notes(main),
    }  # fmt: skip


def _rows(table: pd.DataFrame, kind: type[DocumentPart]) -> list[dict[str, Any]]:
    """Rows of a table, with the columns that a part of a document has."""
    rows: list[Any] = table[[*kind.model_fields]].to_dict(orient="records")
    return rows


def advice(advice: Advice, shown: Advice, folder: Path) -> study_documents.Advice:
    """The points by cost; `shown` is the same with the labels for people."""
    beside = None if advice.beside is None or shown.beside is None else (
        _answer(advice.beside, shown.beside)
    )
    return study_documents.Advice.of(
        {**_answer(advice, shown), "folder": str(folder), "beside": beside}
    )


def _answer(advice: Advice, shown: Advice) -> dict[str, Any]:
    kept = [name for name in study_documents.DesignPoint.model_fields if name != "levels"]
    rows = advice.points.to_dict(orient="records")
    return {
        **{name: getattr(advice, name) for name in study_documents.Answer.model_fields
           if name not in ("answer", "points")},
        "answer": shown.own_answer(),
        "points": [
            {"levels": {name: row[name] for name in advice.factors}, **{k: row[k] for k in kept}}
            for row in rows
        ],
    }  # fmt: skip


def requirement(found: Requirement, folder: Path) -> study_documents.Requirement:
    """The answer to a question."""
    from ...require.report import REPORT, SCENARIO

    terms = found.question.terms
    kept = [name for name in study_documents.DesignDecided.model_fields if name != "levels"]
    return study_documents.Requirement.of(
        {
            **{name: getattr(terms, name) for name in ("limit", "share", "confidence",
                                                       "most_runs")},
            **{name: getattr(found, name) for name in ("chosen", "cheaper", "nearest")},
            "folder": str(folder),
            "report": str(folder / REPORT),
            "scenario": None if found.chosen is None else str(folder / SCENARIO),
            "answer": found.answer(),
            "response": found.question.response,
            "unit": found.question.unit,
            "runs": found.spent,
            "limits": [{"name": n, "without": v} for n, v in found.limits.without.items()],
            "enough": found.limits.enough,
            "designs": [
                {"levels": found.row(number), **{name: row[name] for name in kept}}
                for number, row in enumerate(found.designs.to_dict(orient="records"))
            ],
        }
    )  # fmt: skip
