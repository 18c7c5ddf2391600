"""The end of every report: the method, how to reproduce it, and how to explore its scenario."""

from __future__ import annotations

import json
import re
import shlex
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
    "(−1 low, +1 high; an effect is twice its coefficient). Their uncertainty comes from ",
    "replicates": "The runs of a replicate share their noise (common random numbers), so their "
    "errors are not independent. Effects are computed in each replicate. Their uncertainty is "
    "their scatter over the replicates.",
    "lenth": "The model has as many terms as there are points, so no run is left to estimate the "
    "error from. The uncertainty is Lenth's pseudo standard error, which the small effects give.",
}
ERROR = {
    "pure": "the scatter of the runs about the means of their points (the pure error). It excludes "
    "what the model leaves out.",
    "residual": "the scatter of the runs about the model. It includes what the model leaves out.",
}
DEFINITIONS = (
    "An error is the estimate minus the truth; x, y and z are north, east and down. The total "
    "error is its length. The RMS is over a run, after the settling time; the mean is over runs. "
    "Absolute errors are errors in the world. For errors relative to the platform as it reports "
    "itself, the platform's own error is subtracted: the mean over the beacons of reported minus "
    "true position. Errors relative to the platform's true position exist for receivers that "
    f"estimate their position from it. {ORDER_STATISTIC} {LOST}"
)


PLAY = "Play with the scenario in a browser:"
"""What stands before the command that does."""


def explore(scenario: str, *options: str) -> str:
    """The command that explores a scenario, by its name or file."""
    return shlex.join(["sblcosim", "explore", scenario, *options])


def method(analysis: Factorial) -> str:
    """The source of the uncertainties."""
    text = METHOD[analysis.method]
    return text + ERROR[str(analysis.error)] if analysis.method == "ols" else text


def software() -> PageTable:
    """Versions of all software that produced the numbers."""
    return PageTable("Software", ("Package", "Version"), list(artifacts.software().items()), (1,))


def fmu_table(fmus: Mapping[str, str]) -> PageTable:
    """Hashes of the components' FMUs."""
    return PageTable("FMUs that ran", ("Component", "SHA-256"), list(fmus.items()), (1,))


def seeding(study: Study) -> str:
    """The range of the runs' seeds, and how points share them."""
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
    """A key, or a path of keys, quoted where TOML requires it."""
    return key if re.fullmatch(r"[A-Za-z0-9_.-]+", key) else json.dumps(key, ensure_ascii=False)


def reproduce(
    commands: Sequence[str], lines: Sequence[str], fmus: Mapping[str, str], file: str = ""
) -> Section:
    """How to reproduce the results; `file` is the text of the study's file, if one is needed."""
    given: list[Block] = [Text("Save this under the name below:"), Code(file)]
    blocks: list[Block] = [
        *(given if file else ()),
        Code("\n".join(commands)),
        *(Text(line) for line in lines),
        Text("Equal versions, seeds and FMUs give equal results to the last bit, with any number "
             "of workers. To repeat a run with its full record: sblcosim replay RESULTS RUN_ID."),
        fmu_table(fmus),
        software(),
    ]
    return Section("How to reproduce", "reproduce", blocks, folded=True)
