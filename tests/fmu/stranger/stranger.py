"""Builds the stranger: an FMU that no part of this project has made."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy

HERE = Path(__file__).parent


def build_stranger(
    fmi: int,
    folder: Path,
    edit: Callable[[str], str] = lambda description: description,
    options: tuple[str, ...] = (),
) -> Path:
    """Compile and pack the FMU.

    Parameters
    ----------
    edit
        Changes the text of modelDescription.xml, to break it in some way.
    options
        Of the compiler: ``-DONLY_ONCE`` refuses a second instance in a process.
    """
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / f"stranger{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-shared", "-fPIC", "-O1", f"-DFMI={fmi}", f"-I{headers}", "-o", library]
    subprocess.run([*command, *options, HERE / "stranger.c"], check=True)
    place = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    fmu = folder / f"stranger{fmi}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", edit((HERE / f"fmi{fmi}.xml").read_text()))
        archive.write(library, f"binaries/{place}/{library.name}")
    return fmu
