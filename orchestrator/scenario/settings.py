"""The settings module: start values of all components from keys of a scenario, as C.

It has the bits of Python: the same functions (`sblcosim.models.settings`) are run on numbers here,
and printed as C from there. It needs neither Python nor files, and also runs as WebAssembly.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from math import nan
from pathlib import Path
from typing import Any

from sblcosim.fmus.build import factory
from sblcosim.fmus.build.c_files import c_files
from sblcosim.fmus.build.compiler import Compiler
from sblcosim.models import COMPONENTS
from sblcosim.models.declaration import Variable
from sblcosim.models.settings import boat
from sblcosim.models.settings.expression import Expression, called, statements
from sblcosim.models.settings.keys import OF_RECEIVERS, in_file_units
from sblcosim.models.settings.names import names_of
from sblcosim.models.settings.start_values import TABLES, StartValues, start_values

NAME = "settings"
_FILES = (f"{NAME}.c", "real.h", "freestanding.h")
_OF_TABLES = {name: {v.key: v for v in COMPONENTS[name].of("parameter")} for name in TABLES}


def library(
    beacons: int, compiler: Compiler | None = None, platform: str | None = None
) -> Path:
    """The settings module for a number of beacons, built if it is not in the cache.

    Parameters
    ----------
    compiler
        By default one for the platform, unless the package includes the module.
    platform
        By default that of the compiler, or of this process; `sblcosim.fmus.platforms.WASM` makes
        WebAssembly.

    Returns
    -------
    Path
        A shared library, or a module of WebAssembly.

    Raises
    ------
    BuildError
        There is no compiler, or it fails.
    """
    return factory.library(NAME, sources(beacons), compiler=compiler, platform=platform)


def key(beacons: int, platform: str) -> str:
    """Cache key of the module for a platform."""
    return factory.library_key(NAME, sources(beacons), False, platform)


def sources(beacons: int) -> dict[str, bytes]:
    """All its C files by name."""
    return {
        **c_files(_FILES),
        "string.h": b'#include "freestanding.h"\n',
        "start_values.h": "\n".join(_equations(start_values(beacons))).encode(),
    }


def values_of(found: StartValues) -> tuple[Expression, ...]:
    """What the module computes, in its order; equal values only once."""
    of_parameters = (it for values in found.computed.values() for it in values)
    return tuple(dict.fromkeys([*of_parameters, *found.levels.values()]))


def description(beacons: int) -> dict[str, Any]:
    """How to call the module, for any program: plain lists and mappings.

    Returns
    -------
    dict
        ``keys``: names of its inputs, in order. ``optional``: keys that need not be given; NaN
        stands for them. ``values``: parameters that it computes, and for each of their elements
        the place in its output. ``levels``: what a bound needs besides, and its places.
        ``copies``: parameters that are the value of a key. ``depends``: the keys that each computed
        parameter depends on. ``unknown``: parameters that may be NaN, and the keys that decide
        this.
    """
    found = start_values(beacons)
    place = {it: number for number, it in enumerate(values_of(found))}
    return {
        "beacons": beacons,
        "keys": [*found.inputs],
        "values": {name: [place[it] for it in own] for name, own in found.computed.items()},
        "levels": {name: place[it] for name, it in found.levels.items()},
        "copies": dict(found.copied),
        "optional": sorted(found.optional),
        "depends": {name: [*keys] for name, keys in found.keys.items()},
        "unknown": {name: [*keys] for name, keys in found.unknown.items()},
    }


def keys_of(scenario: Any) -> list[float]:
    """The inputs of the module for a scenario, in their order.

    Parameters
    ----------
    scenario
        A loaded scenario, or an object with the same tables.
    """
    of, moving = start_values(scenario.beacons), boat.inputs(scenario.platform)
    return [
        moving[name] if name in moving else _element(scenario, *name.partition("["), of.optional)
        for name in of.inputs
    ]


def _element(
    scenario: Any, path: str, bracket: str, rest: str, optional: Collection[str]
) -> float:
    """A number of a key; names have one."""
    name, key = path.split(".")
    table = getattr(scenario, name)
    if path in optional and key not in table.model_fields_set:
        return nan
    value = getattr(table, key)
    if bracket:
        variable = _variable(name, key)
        row, *column = (int(place) - 1 for place in rest.rstrip("]").split(","))
        at = row * variable.shape[-1] + column[0] if column else row
        # A list may have fewer rows than there is room for.
        value = value[at] if at < len(value) else in_file_units(variable, variable.starts[at])
    if not isinstance(value, str):
        return float(value)
    variable = _variable(name, key)
    return float({**names_of(variable), **(variable.named or {})}[value])


def _variable(table: str, key: str) -> Variable:
    """The parameter of a key."""
    return OF_RECEIVERS[key] if table == "receiver" else _OF_TABLES[table][key]


def _equations(found: StartValues) -> Iterator[str]:
    values = values_of(found)
    place = {name: f"keys[{number}]" for number, name in enumerate(found.inputs)}
    yield "/* Generated from models/settings. */"
    yield f"enum {{ N_KEYS = {len(place)}, N_VALUES = {len(values)} }};\n"
    for name, (arguments, result) in called(values).items():
        taken = ", ".join(f"double {it}" for it in arguments)
        yield from _function(
            f"__attribute__((noinline)) double {name}({taken})",
            ["double result;", *statements({"result": result}, str), "return result;"],
        )
    body = statements({f"values[{n}]": it for n, it in enumerate(values)}, place.__getitem__)
    yield from _function("void start_values(const double *keys, double *values)", [*body])


def _function(signature: str, lines: Sequence[str]) -> list[str]:
    return [f"static {signature}", "{", *(f"    {line}" for line in lines), "}\n"]
