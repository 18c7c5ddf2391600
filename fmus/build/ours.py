"""Which FMUs were built here: known by their bytes, so that nothing in them is run to find out."""

from __future__ import annotations

import re

from sblcosim.models import COMPONENTS

from ..files import intact, sha256_of
from . import factory


def is_build(identifier: str, sha256: str) -> bool:
    """Whether a file is among the FMUs that came along or are cached, built of equations.

    Parameters
    ----------
    identifier
        Of its model.
    sha256
        Of its content.
    """
    of_ours = (
        path
        for name, component in COMPONENTS.items()
        if re.fullmatch(rf"{component.name}\d*", identifier)
        for folder in (factory.READY, factory.cache())
        for path in folder.glob(f"*/{name}{identifier.removeprefix(component.name)}.fmu")
    )
    of_users = factory.cache().glob(f"{factory.USERS}*/*.fmu")
    return any(intact(path) and sha256_of(path) == sha256 for path in (*of_ours, *of_users))
