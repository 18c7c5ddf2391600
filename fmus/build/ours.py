"""Which FMUs were built here: recognised by their bytes, so that none is run to find out."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from sblcosim.models import COMPONENTS

from ..files import intact, sha256_of
from . import factory


def is_build(path: Path, identifier: str, sha256: str) -> bool:
    """Whether an FMU is a ready-made or cached one, built from equations.

    Parameters
    ----------
    path
        The FMU. A copy is looked for by its content.
    identifier
        Model identifier.
    sha256
        SHA-256 of its content.
    """
    return any(
        intact(built) and sha256_of(built) == sha256 for built in _candidates(path, identifier)
    )


def _candidates(path: Path, identifier: str) -> Iterator[Path]:
    folders = factory.READY, factory.cache()
    if path.parent.parent in folders:  # no search through a cache, which may hold a thousand FMUs
        yield path
    for name, component in COMPONENTS.items():
        if re.fullmatch(rf"{component.name}\d*", identifier):
            for folder in folders:
                yield from folder.glob(f"*/{name}{identifier.removeprefix(component.name)}.fmu")
    yield from factory.cache().glob(f"{factory.USERS}*/*.fmu")
