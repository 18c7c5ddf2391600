"""Names that are imported on first use."""

from __future__ import annotations

from types import ModuleType

import pytest
import sblcosim
from sblcosim import analysis, limits, study


@pytest.mark.parametrize(
    "package",
    [sblcosim, study, analysis, limits],
    ids=lambda package: package.__name__,
)
def test_a_name_stays_what_it_is(package: ModuleType) -> None:
    """A module of the same name would take its place as soon as it is imported."""
    for name in package.__all__:
        first, second = getattr(package, name), getattr(package, name)
        assert first == second, name
