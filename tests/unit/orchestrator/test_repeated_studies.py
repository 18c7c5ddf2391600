"""How a report says that its study is repeated: by its name, or by a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sblcosim.report import study as reports
from sblcosim.report.page import Code, Section
from sblcosim.study import store
from sblcosim.study.study import Study, load, shipped
from seams import Seam

OUT = Path("some folder")


def code(section: Section) -> list[str]:
    """The lines of code of a section, and of those in it."""
    own = [block.text for block in section.blocks if isinstance(block, Code)]
    return [*own, *(line for part in section.parts for line in code(part))]


def repeated(study: Study, seam: Seam) -> str:
    seam.instead(store.described, lambda _: {"definition": {"fmus": {}}})
    return "\n".join(code(reports.how_to_repeat(study, OUT, "the command")))


@pytest.mark.parametrize("name", shipped())
def test_a_shipped_study_is_repeated_by_its_name(name: str, seam: Seam) -> None:
    study = load(name)
    said = repeated(study, seam)
    assert f"sblcosim study {name} --out 'some folder'" in said
    assert "--replicates" not in said
    assert "the command" in said
    count = study.replicates + 1
    assert f"sblcosim study {name} --replicates {count} --out" in repeated(
        study.with_replicates(count), seam
    )


@pytest.mark.parametrize("changes", [
    {"settling_time_s": 3.5}, {"fixed": {"time": {"duration_s": 17.0}}}, {"name": "another"},
])  # fmt: skip
def test_another_study_of_the_same_name_is_repeated_by_its_file(
    changes: dict[str, Any], seam: Seam
) -> None:
    tables = load("paper-scenario-1").tables()
    same = load({**tables, "title": "Another title"})
    assert "sblcosim study paper-scenario-1 --out" in repeated(same, seam)
    said = repeated(load({**tables, **changes}), seam)
    name = changes.get("name", "paper-scenario-1")
    assert f"sblcosim study {name}.toml --out 'some folder'" in said
