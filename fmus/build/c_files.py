"""The C files that are the same in every FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources

from ..standard import Fmi

SHELLS: Mapping[Fmi, str] = {2: "fmi2.c", 3: "fmi3.c"}
"""The functions of the standard, by its version."""
SHARED: tuple[str, ...] = ("-DSHARED_ENGINE",)
"""What lets the functions of FMI use the engine for one simulation, instead of their own."""
LANES = ("lanes.h", "lanes.c", "dispatch.c", "widest.h")
"""The entry for many simulations side by side."""
WASM = ("wasm.c", "freestanding.h")
"""The entry of a component as WebAssembly, and what it needs in place of a C library."""
FIRMWARE = ("firmware.c", "soft_sqrt.h")
"""A receiver without FMI, for a microcontroller."""
SELFTEST: Mapping[str, str] = {
    "selftest.c": "firmware_selftest.c", "measure.h": "firmware_measure.h",
    "board.c": "firmware_board.c", "board.ld": "firmware_board.ld",
}
"""Its self-test and the start of a program on a board, by their names in its folder."""
BOUND = ("bound.c", "bound.h", "elementary.h", "real.h", "widest.h")
"""The recursion of a bound."""
HEADERS = (
    "elementary.h", "engine.h", "instance.h", "life_cycle.h", "noise.h", "philox.h", "real.h",
    "shared.h", "snapshots.h", "steps.h", "values.h",
)


def c_files(names: Sequence[str]) -> dict[str, bytes]:
    """The contents of files of ``fmus/c`` by their names."""
    folder = resources.files("sblcosim.fmus") / "c"
    return {name: (folder / name).read_bytes() for name in names}


def engine_headers() -> dict[str, bytes]:
    """The headers of the engine and of its lanes, by file name."""
    return c_files([*HEADERS, "lanes.h", "widest.h"])
