"""Contents of an FMU, and how they are packed."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import BuildError
from ..files import write_file
from ..known_as import KNOWN_AS, note
from ..platforms import in_folders, suffix
from ..standard import Fmi
from ..terminals import PORTS, TERMINALS
from .description import PACKAGE, build_description, model_description, terminals
from .documentation import index_html

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

DESCRIPTION = "modelDescription.xml"


def contents(
    model: Model,
    fmi: Fmi,
    token: str,
    sources: Mapping[str, bytes],
    binaries: Mapping[str, bytes],
) -> Mapping[str, bytes]:
    """Return all files of an FMU by their names in the archive.

    Parameters
    ----------
    token
        FMI 2 ``guid``, FMI 3 ``instantiationToken``, as in the C code.
    sources
        C files by name. Those that end in ``.c`` are compiled, all others are included.
    binaries
        Shared libraries by platform, a name of `sblcosim.fmus.platforms`.
    """
    component = model.component
    compiled = sorted(name for name in sources if name.endswith(".c"))
    text = licence()
    files = {"documentation/licenses/license.txt": text.encode()}
    if compiled:
        files["sources/buildDescription.xml"] = build_description(component, compiled)
    files |= {f"sources/{name}": data for name, data in sources.items()}
    files |= {
        f"binaries/{folder}/{component.name}{suffix(folder)}": data
        for folder, data in in_folders(binaries, fmi).items()
    }
    less = model_description(model, fmi, token, compiled)
    plain = files | _told(_without_others(model), fmi, less)
    files |= _told(model, fmi, model_description(model, fmi, token, compiled, _copyright(text)))
    return files | {KNOWN_AS: note(pack(plain), files)}


def _told(model: Model, fmi: Fmi, description: bytes) -> dict[str, bytes]:
    """The files that describe the model."""
    plugs = terminals(model, fmi)
    return {
        DESCRIPTION: description,
        "documentation/index.html": index_html(model, fmi).encode(),
        **({} if plugs is None else {TERMINALS: plugs}),
    }


def _without_others(model: Model) -> Model:
    """The model with only those terminals that name ports of receivers."""
    own = tuple(terminal for terminal in model.component.terminals if terminal.kind in PORTS)
    return replace(model, component=replace(model.component, terminals=own))


def _copyright(text: str) -> str:
    """The line of a licence that names the copyright holder."""
    return next(line for line in text.splitlines() if line.startswith("Copyright"))


def licence() -> str:
    """Text of the project's licence, as it was installed.

    Raises
    ------
    BuildError
        The package was installed without it.
    """
    for distribution in metadata.distributions(name=PACKAGE):
        # Installed, or (when run from the source folder) left there by a build.
        for file in ("licenses/LICENSE", "../LICENSE"):
            text = distribution.read_text(file)
            if text is not None:
                return text
    raise BuildError(f"{PACKAGE}: the licence must be installed with the package, got none")


def write_fmu(path: Path, files: Mapping[str, bytes]) -> None:
    """Pack files into an FMU, which appears under its name only when it is complete."""
    write_file(path, pack(files))


def pack(files: Mapping[str, bytes]) -> bytes:
    """Pack files into an FMU; equal files give equal bytes.

    Parameters
    ----------
    files
        Contents by name in the archive.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(files, key=lambda name: (name != DESCRIPTION, name)):
            archive.writestr(_entry(name), files[name], compresslevel=9)
    return packed.getvalue()


def _entry(name: str) -> zipfile.ZipInfo:
    """Directory entry that depends on the name alone."""
    entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system = 3  # Unix on every system: otherwise the permissions mean nothing
    permissions = 0o755 if name.startswith("binaries/") else 0o644
    entry.external_attr = (0o100000 | permissions) << 16
    return entry
