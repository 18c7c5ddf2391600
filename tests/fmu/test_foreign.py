"""The FMUs of others, if there are any: set ``SBLCOSIM_FOREIGN_FMUS`` to a folder of them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from .foreign import listed, row

FOLDER = Path(os.environ.get("SBLCOSIM_FOREIGN_FMUS", ""))
FOUND = sorted(FOLDER.rglob("*.fmu")) if FOLDER.name else []


def test_the_list_has_the_reference_fmus_and_they_violate_nothing() -> None:
    reference = {n: cells for n, cells in listed().items() if n.startswith("Reference-FMUs/")}
    assert {Path(name).stem for name in reference} == {
        "BouncingBall", "Clocks", "Dahlquist", "Feedthrough", "Resource", "Roberts", "Stair",
        "StateSpace", "VanDerPol",
    }  # fmt: skip
    for name, (_, _, code, failed, _) in reference.items():
        clocks = name.endswith("Clocks.fmu")
        assert (code, failed) == (
            ("2", "must be an FMU for Co-Simulation, got Scheduled Execution")
            if clocks
            else ("0", "")
        )


@pytest.mark.skipif(not FOUND, reason="needs SBLCOSIM_FOREIGN_FMUS, a folder of FMUs")
@pytest.mark.parametrize("path", FOUND, ids=[p.relative_to(FOLDER).as_posix() for p in FOUND])
def test_the_kit_says_of_an_fmu_what_the_list_says(path: Path) -> None:
    assert row(path, FOLDER) == listed()[path.relative_to(FOLDER).as_posix()]
