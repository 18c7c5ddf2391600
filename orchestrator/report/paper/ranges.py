"""A modern form of the paper's question: Sobol' indices over the continuous ranges of Table 3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from ...analysis import workflow
from ...analysis.space import sentences
from ...analysis.space.analysis import Sensitivity
from ...study import study as studies
from ...study.space import SEED_FACTOR
from ...study.study import Study
from ...words.numbers import interval, number, signed
from ..page import Block, PageTable, Text
from ..two_level import Findings

BASE_ROWS, QUICK_BASE_ROWS = 256, 32
SEED = 60001
"""The seeds of scenario n begin at this number plus 10,000 n."""


def spaces(quick: bool, scenarios: Sequence[int]) -> dict[str, Study]:
    """The factors of Table 3, each uniform between its two levels, by the names of the folders."""
    made = {}
    for n in scenarios:
        table = studies.load(f"paper-scenario-{n}")
        made[f"ranges-{n}"] = studies.load({
            "name": f"ranges-{n}", "title": f"The ranges of Table 3 in Scenario {n}",
            "scenario": f"paper-scenario-{n}", "seed": SEED + 10_000 * n,
            "design": {"kind": "space",
                       "base_rows": QUICK_BASE_ROWS if quick else BASE_ROWS},
            "factors": {
                name: {"keys": factor.keys, "label": factor.label, "unit": factor.unit,
                       "distribution": "uniform", "range": [*map(float, sorted(factor.values))]}
                for name, factor in table.factors.items()
            },
        })  # fmt: skip
    return made


def indices(study: Study, table: pd.DataFrame) -> tuple[Sensitivity, ...]:
    """Indices of the logarithm of the total error, and of whether the filter is lost."""
    return workflow.of_space(study, table)


def blocks(analyses: Sequence[Sensitivity], findings: Findings) -> list[Block]:
    """The total indices beside the two-level effects."""
    main = analyses[0]
    a = findings.data
    own = f" [{a.unit}]" if a.unit else ""
    effects = a.effects["effect"].to_dict()
    rows = []
    for name, given in main.ranked().iterrows():
        row: Any = given
        is_chance = name == SEED_FACTOR
        rows.append((
            main.name_of(str(name)),
            "–" if is_chance else signed(effects[str(name)]),
            number(row["first"], 2), interval(row["first_low"], row["first_high"], _two),
            number(row["total"], 2), interval(row["total_low"], row["total_high"], _two),
        ))  # fmt: skip
    head = ("Factor", f"Effect, low to high{own}", "First-order index", "95 % interval",
            "Total index", "95 % interval")
    return [
        Text(sentences.answer(main), "answer"),
        PageTable("Sources of the variance of the logarithm of the error over the whole ranges",
              head, rows, (),
              "The effects are those between the two levels. The indices are shares of the "
              "variance when all seven factors are uniform between their levels: the first-order "
              "index without interactions, the total index with all of them. The seed is one of "
              "the factors; its index is chance."),
        *(Text(line, "note") for line in sentences.notes(main)),
    ]  # fmt: skip


def _two(value: float) -> str:
    return number(value, 2)
