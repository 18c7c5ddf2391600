"""The loops in C: as they came with the package, or compiled when they are first needed."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

from sblcosim.fmus import compiler, factory
from sblcosim.fmus.errors import BuildError

FOLDER = Path(__file__).with_name("c")


@cache
def load(name: str, lanes: bool = False, header: str = "") -> ctypes.CDLL:
    """Load a driver.

    Parameters
    ----------
    name
        Of its source in ``c/``, without the suffix.
    lanes
        Whether it is built once per number of lanes, with the engine's headers.
    header
        Text of its generated header, of the same name.

    Raises
    ------
    BuildError
        It has to be compiled, and there is no compiler or it fails.
    """
    path = FOLDER / f"{name}.so"
    if not path.is_file():
        file = f"{name}.c"
        sources = {file: (FOLDER / file).read_bytes()}
        if header:
            sources[f"{name}.h"] = header.encode()
        if lanes:
            sources |= factory.engine_headers()
        units = factory.lane_units(file) if lanes else (factory.Unit(file),)
        path = factory.library(name, sources, units)
    return ctypes.CDLL(str(path))


def available(name: str) -> bool:
    """Whether a driver is there or could be compiled."""
    try:
        return (FOLDER / f"{name}.so").is_file() or bool(compiler.find())
    except BuildError:
        return False
