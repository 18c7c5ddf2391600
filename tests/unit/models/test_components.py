"""The list of all components."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sblcosim.models import COMPONENTS, RECEIVERS, check_unique, module_of


def test_every_component_has_a_number_and_a_name_of_its_own() -> None:
    check_unique(COMPONENTS)


@pytest.mark.parametrize("field", ["number", "name"])
def test_components_that_share_a_number_or_a_name_are_both_named(field: str) -> None:
    taken = getattr(COMPONENTS["acoustics"], field)
    components = {**COMPONENTS, "mine": replace(COMPONENTS["ekf"], number=99, name="Mine")}
    check_unique(components)
    components["mine"] = replace(components["mine"], **{field: taken})
    got = f"{field} of its own, got '?{taken}'? for acoustics and mine"
    with pytest.raises(ValueError, match=got):
        check_unique(components)


def test_receivers_share_a_folder() -> None:
    assert {module_of(name)[0] for name in RECEIVERS} == {"receiver"}
    assert module_of("target") == ("target", "equations")
