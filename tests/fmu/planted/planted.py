"""Builds the FMU with a planted defect."""

from __future__ import annotations

import re
import subprocess
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import fmpy

HERE = Path(__file__).parent
DEFECTS = re.findall(
    r"^    ([A-Z_]+),", (HERE / "planted.c").read_text().split("enum defect")[1], re.MULTILINE
)
"""Names of the defects, in the order of their numbers."""


def build_planted(
    fmi: int,
    folder: Path,
    defect: str = "NONE",
    edit: Callable[[str], str] = lambda description: description,
    options: tuple[str | Path, ...] = (),
    more: Mapping[str, Path] = MappingProxyType({}),
) -> Path:
    """Compile and pack the FMU.

    Parameters
    ----------
    defect
        One of `DEFECTS`.
    edit
        Changes the text of modelDescription.xml, to break it in some way.
    options
        Of the linker.
    more
        Further files, by their names beside the library.
    """
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / f"planted{fmpy.sharedLibraryExtension}"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter",
         "-Wno-format",
         f"-DFMI={fmi}", f"-DDEFECT={DEFECTS.index(defect)}", "-o", library, HERE / "planted.c",
         "-lm", *options],
        check=True,
    )  # fmt: skip
    place = fmpy.platform if fmi == 2 else fmpy.platform_tuple
    fmu = folder / f"planted{fmi}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", edit((HERE / f"fmi{fmi}.xml").read_text()))
        for name, path in {library.name: library, **more}.items():
            archive.write(path, f"binaries/{place}/{name}")
    return fmu
