"""The versions that are declared, pinned and tested belong together."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINNED = {
    canonicalize_name(name): version
    for name, version in re.findall(
        r"^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(), re.M
    )
}
DECLARED = [
    Requirement(text)
    for group in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    for text in group
    if not text.startswith(PROJECT["name"])
]


@pytest.mark.parametrize("requirement", DECLARED, ids=str)
def test_the_pinned_version_is_one_of_the_declared(requirement: Requirement) -> None:
    assert requirement.specifier.contains(PINNED[canonicalize_name(requirement.name)])


def test_every_package_that_users_get_has_a_lowest_version() -> None:
    stubs = {"pandas-stubs", "scipy-stubs"}  # read by mypy only, with the pinned versions
    for requirement in DECLARED:
        if requirement.name not in stubs:
            assert any(s.operator == ">=" for s in requirement.specifier), requirement
