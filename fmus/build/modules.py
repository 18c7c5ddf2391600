"""Whole simulations as WebAssembly: the engines of several components and a driver, one module."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from . import factory
from .c_files import WASM, c_files
from .ingredients import ingredients

FLAGS: Mapping[int, tuple[str, ...]] = {1: (), 2: ("-msimd128",)}
"""Numbers of simulations side by side, and the compiler's flags for each."""
SECTION = "sblcosim"
"""Name of a module's custom section with its description, JSON."""
_TABLE = "engines.h"


def module(
    file: str,
    driver: Mapping[str, bytes],
    components: Sequence[str],
    lanes: int,
    description: Mapping[str, object],
    **constants: int,
) -> Path:
    """Return a module of WebAssembly without imports, built only if it has changed.

    Parameters
    ----------
    file
        Name of the file.
    driver
        C sources by name. The first is compiled; it finds the engines in the macro ``ENGINES`` of
        the header ``engines.h``.
    components
        Keys of `sblcosim.models.COMPONENTS`.
    lanes
        Simulations side by side: a key of `FLAGS`.
    description
        What the module says of itself, in its section `SECTION`.
    constants
        Constants of the build: ``beacons=6``.

    Raises
    ------
    BuildError
        CasADi or ``ziglang`` is missing, or the compiler fails.
    """
    entry, flags, strings = next(iter(driver)), _flags(lanes), _strings()
    sources = _sources(driver, components)

    def parts() -> Iterator[tuple[Mapping[str, bytes], factory.Unit]]:
        # CasADi is loaded only when something has to be built.
        from sblcosim.models.loading import load

        yield sources, factory.Unit(entry, flags)
        for name in components:
            own = factory.engine_sources(load(name, **constants))
            renamed = f"-Dlanes_{lanes}={_symbol(name)}"
            yield (
                {**own, **c_files(("lanes.h", "lanes.c")), **strings},
                factory.Unit("lanes.c", (*flags, renamed)),
            )

    of = key(driver, components, lanes, description, **constants)
    return factory.kept_module(file, of, parts, _section(description))


def key(
    driver: Mapping[str, bytes],
    components: Sequence[str],
    lanes: int,
    description: Mapping[str, object],
    **constants: int,
) -> str:
    """Cache key of everything that a module is made from; arguments as for `module`."""
    facts = [
        [ingredients(name, 3, **constants) for name in components], _section(description).hex(),
        _flags(lanes), Path(__file__).read_text("utf-8"),
    ]
    return factory.key_of_sources(facts, (), _sources(driver, components))


def _section(description: Mapping[str, object]) -> bytes:
    return custom_section(SECTION, json.dumps(description).encode())


def _flags(lanes: int) -> tuple[str, ...]:
    return (f"-DLANES={lanes}", *FLAGS[lanes])


def _strings() -> dict[str, bytes]:
    return {"string.h": c_files(WASM)["freestanding.h"]}


def _sources(driver: Mapping[str, bytes], components: Sequence[str]) -> dict[str, bytes]:
    """The driver with the table of the engines."""
    listed = " ".join(f"X({_symbol(name)})" for name in components)
    return {**driver, **_strings(), _TABLE: f"#define ENGINES(X) {listed}\n".encode()}


def _symbol(component: str) -> str:
    """Name of a component's engine in the module."""
    return f"engine_{component}"


def custom_section(name: str, content: bytes) -> bytes:
    """A custom section of the binary format of WebAssembly (its specification, section 5.5.3)."""
    body = _unsigned(len(name)) + name.encode() + content
    return b"\0" + _unsigned(len(body)) + body


def _unsigned(value: int) -> bytes:
    """An integer in LEB128."""
    parts = bytearray()
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])
