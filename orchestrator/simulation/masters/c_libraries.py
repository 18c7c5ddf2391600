"""The masters' C loops: shipped with the package, or compiled on first use."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sblcosim.fmus.build import c_files, factory
from sblcosim.fmus.build.compiler import Compiler
from sblcosim.fmus.errors import BuildError

FOLDER = Path(__file__).with_name("c")


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver's sources and how to build it.

    Attributes
    ----------
    name
        Name of its source file in ``c/``, without the suffix.
    lanes
        Whether to build it once per number of lanes, with the engine's headers.
    header
        Text of its generated header, which has the same name.
    includes
        Names of further headers in ``c/``.
    folder
        The folder ``c/``; None: that of the masters.
    """

    name: str
    lanes: bool = False
    header: str = ""
    includes: tuple[str, ...] = ()
    folder: Path | None = None


def library(driver: Driver, compiler: Compiler | None = None) -> Path:
    """Path of a driver's shared library: for this process, or for a given compiler's platform.

    Raises
    ------
    BuildError
        The library must be compiled, but there is no compiler or it fails.
    """
    return factory.library(driver.name, sources(driver), driver.lanes, compiler)


def key(driver: Driver, platform: str) -> str:
    """Cache key of a driver, made from everything except the compiler."""
    return factory.library_key(driver.name, sources(driver), driver.lanes, platform)


def sources(driver: Driver) -> dict[str, bytes]:
    """All C files of a driver, by name."""
    files, folder = (f"{driver.name}.c", *driver.includes), driver.folder or FOLDER
    found = {file: (folder / file).read_bytes() for file in files}
    if driver.header:
        found[f"{driver.name}.h"] = driver.header.encode()
    if driver.lanes:
        found |= c_files.engine_headers()
    return found


@cache
def load(driver: Driver) -> ctypes.CDLL:
    """Load a driver.

    Raises
    ------
    BuildError
        As `library`.
    """
    return ctypes.CDLL(str(library(driver)))


def available(driver: Driver) -> bool:
    """Whether a driver is present or can be compiled."""
    try:
        return bool(library(driver))
    except BuildError:
        return False
