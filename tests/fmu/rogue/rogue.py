"""Builds the rogue: a receiver that does to its process what it is told to do."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
PHASES = (
    "load", "instantiate", "setup", "initialise", "set", "step", "get", "terminate", "free",
    "unload",
)  # fmt: skip
"""Where it can misbehave, in their order."""
DEADLY = {
    "exit": "ended the process (exit code 0)",
    "_exit": "ended the process (exit code 3)",
    "segv": "crashed (signal SIGSEGV)",
    "abort": "crashed (signal SIGABRT)",
    "fpe": "crashed (signal SIGFPE)",
    "bus": "crashed (signal SIGBUS)",
    "thread": "crashed (signal SIGSEGV)",
    "hang": "has not returned",
}
"""Ways after which there is no process any more, and what is said of them."""


def compile_rogue(folder: Path) -> Path:
    """The library."""
    library = folder / f"rogue{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", f"-I{headers}", "-o", library,
         HERE / "rogue.c", "-lm", "-lpthread"],
        check=True,
    )  # fmt: skip
    return library


def rogue(library: Path, folder: Path, what: str, phase: str, content: bytes | None = None) -> Path:
    """An FMU that misbehaves in one way; content is what is in place of the library's own."""
    path = folder / f"{what.strip('_')}_{phase}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", (HERE / "fmi2.xml").read_text())
        place = f"binaries/{fmpy.platform}"
        whole = library.read_bytes() if content is None else content
        archive.writestr(f"{place}/{library.name}", whole)
        archive.writestr(f"{place}/how", f"{what} {phase}")
    return path
