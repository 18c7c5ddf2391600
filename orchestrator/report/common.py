"""The end of every report: the method, and how to reproduce it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from .. import artifacts
from ..analysis.two_level.analysis import Factorial
from ..judge.definitions import LOST
from ..results.responses import ORDER_STATISTIC
from ..scenario.schema import toml
from ..study.study import Study
from .page import Block, Code, PageTable, Section, Text

METHOD = {
    "ols": "Each run has noise of its own. Effects come from ordinary least squares in coded units "
    "(−1 low, +1 high; an effect is twice its coefficient), their uncertainty from ",
    "replicates": "The runs of a replicate share their noise (common random numbers), so that "
    "their errors are not independent. Effects are taken in each replicate; their uncertainty is "
    "their scatter over the replicates.",
    "lenth": "As many terms as points: no run is left to estimate the error from. The uncertainty "
    "is Lenth's pseudo standard error, from the small effects themselves.",
}
ERROR = {
    "pure": "the scatter of the runs about the means of their points (the pure error), which holds "
    "nothing of what the model leaves out.",
    "residual": "the scatter of the runs about the model, which also holds what the model leaves "
    "out.",
}
DEFINITIONS = (
    "Errors are estimate minus truth, x, y, z north, east, down; the total error is their length. "
    "The RMS is over a run, after the settling time; the mean is over runs. Absolute errors are "
    "those in the world. Errors relative to the platform as it reports itself are less the mean "
    "over the beacons of reported minus true position; errors relative to the platform's true "
    "position are those of receivers that say by themselves where they are from it. "
    f"{ORDER_STATISTIC} {LOST}"
)


def method(analysis: Factorial) -> str:
    """Where the uncertainties come from."""
    text = METHOD[analysis.method]
    return text + ERROR[str(analysis.error)] if analysis.method == "ols" else text


def software() -> PageTable:
    """Versions of all software behind the numbers."""
    return PageTable("Software", ("Package", "Version"), list(artifacts.software().items()), (1,))


def fmu_table(fmus: Mapping[str, str]) -> PageTable:
    """Hashes of the components' FMUs."""
    return PageTable("FMUs that ran", ("Component", "SHA-256"), list(fmus.items()), (1,))


def seeding(study: Study) -> str:
    """The seeds of the runs."""
    last = study.run_seed(len(study.points.values), study.replicates)
    how = {"independent": "each run has its own", "common": "the points of a replicate share one"}
    return f"seeds {study.seed} to {last} ({how[study.seeding]})"


def as_toml(tables: Mapping[str, Any], above: str = "") -> str:
    """Nested tables as the text of a TOML file."""
    lines = [f"{_toml_key(key)} = {toml(value)}" for key, value in tables.items()
             if not isinstance(value, Mapping) and value is not None]
    text = "\n".join([*([f"[{above}]"] if above and lines else []), *lines])
    below = [
        as_toml(value, f"{above}.{_toml_key(key)}" if above else _toml_key(key))
        for key, value in tables.items() if isinstance(value, Mapping)
    ]
    return "\n\n".join(part for part in (text, *below) if part)


def _toml_key(key: str) -> str:
    """A key, or a path of keys, quoted where TOML wants it."""
    return key if re.fullmatch(r"[A-Za-z0-9_.-]+", key) else json.dumps(key, ensure_ascii=False)


def reproduce(
    commands: Sequence[str], lines: Sequence[str], fmus: Mapping[str, str], file: str = ""
) -> Section:
    """How to reproduce the results; `file` is the text of the study's file, if it needs one."""
    given: list[Block] = [Text("Save this as a file of the name below:"), Code(file)]
    blocks: list[Block] = [
        *(given if file else ()),
        Code("\n".join(commands)),
        *(Text(line) for line in lines),
        Text("Equal versions, seeds and FMUs give equal results to the last bit, whatever the "
             "number of workers. Any run can be done again with its full record: "
             "sblcosim replay RESULTS RUN_ID."),
        fmu_table(fmus),
        software(),
    ]
    return Section("How to reproduce", "reproduce", blocks, folded=True)
