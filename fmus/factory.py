"""From the name of a component to a finished FMU, built at most once."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import uuid
from collections.abc import Iterator, Mapping
from importlib import metadata, resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path

from ..models import COMPONENTS, module_of
from . import compiler as compilers
from .errors import BuildError, nearest

if TYPE_CHECKING:
    from ..models.equations import Model
    from .description import Fmi

CACHE_VARIABLE = "SBLCOSIM_CACHE"
"""Environment variable that names the folder for built FMUs, in place of the user's cache."""

_SHELLS = {2: "fmi2.c", 3: "fmi3.c"}
_HEADERS = ("engine.h", "elementary.h", "instance.h", "noise.h", "philox.h", "real.h")


def build(name: str, fmi: Fmi = 2) -> Path:
    """Return the FMU of a component for this machine; it is built if it has changed.

    Parameters
    ----------
    name
        A key of `sblcosim.models.COMPONENTS`.
    fmi
        Version of the standard, 2 or 3.

    Returns
    -------
    Path
        ``NAME.fmu`` in the user's cache, in a folder named after everything it was made from.

    Raises
    ------
    BuildError
        There is no such component or no compiler, or the compiler fails.
    """
    if name not in COMPONENTS:
        raise BuildError(
            f"a component must be one of {', '.join(COMPONENTS)}; got {name!r}"
            f"{nearest(name, COMPONENTS)}"
        )
    if fmi not in _SHELLS:
        raise BuildError(f"the FMI version must be 2 or 3, got {fmi!r}")
    compiler = compilers.find()
    path = cache() / _fingerprint(name, fmi, compiler) / f"{name}.fmu"
    if not path.is_file():
        write(path, name, fmi, compiler)
    return path


def write(path: Path, name: str, fmi: Fmi, compiler: compilers.Compiler) -> None:
    """Build the FMU of a component; equal sources and compiler give equal bytes."""
    # CasADi and the XML are loaded only when something has to be built.
    from ..models.equations import load
    from .archive import contents, platform_folder, this_machine, write_fmu

    model = load(name)
    sources = _sources(model, fmi)
    token = _token(model, sources, fmi)
    sources["tables.h"] = _tables(model, token)
    binary = compile_shared(sources, [_SHELLS[fmi]], compiler)
    folder = platform_folder(*this_machine(), fmi)
    write_fmu(path, contents(model, fmi, token, sources, {folder: binary}))


def cache() -> Path:
    """The folder that holds built FMUs."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else user_cache_path("sblcosim") / "fmus"


def engine_sources(model: Model) -> dict[str, bytes]:
    """The C sources of a component's equations and their engine, by file name."""
    from .generator import model_source

    return {**_c_files(_HEADERS), "model.h": model_source(model).encode()}


def compile_shared(
    sources: Mapping[str, bytes], units: list[str], compiler: compilers.Compiler,
    flags: tuple[str, ...] = (),
) -> bytes:
    """Compile C sources into a shared library.

    Parameters
    ----------
    sources
        All files by name.
    units
        Names of those to compile; the others are included.
    """
    with tempfile.TemporaryDirectory(prefix="sblcosim-") as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_bytes(text)
        library = folder / "component.so"
        # Relative names: the path of the folder must not get into the library.
        compiler.compile(
            [Path(unit) for unit in units], Path(library.name), [Path(), fmi_headers()], flags,
            cwd=folder,
        )
        return library.read_bytes()


def fmi_headers() -> Path:
    """The folder with the FMI headers that come with FMPy."""
    import fmpy

    return Path(fmpy.__file__).parent / "c-code"


def _sources(model: Model, fmi: Fmi) -> dict[str, bytes]:
    return {**engine_sources(model), **_c_files([_SHELLS[fmi]])}


def _tables(model: Model, token: str) -> bytes:
    from .description import value_references
    from .generator import table_source

    return table_source(model.component, token, value_references(model.component)).encode()


def _token(model: Model, sources: Mapping[str, bytes], fmi: Fmi) -> str:
    """GUID or instantiation token: the same for the same interface and equations."""
    digest = hashlib.sha256(_tables(model, ""))
    for file in sorted(sources):
        digest.update(file.encode() + b"\0" + sources[file])
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}" if fmi == 2 else str(
        uuid.UUID(bytes=digest.digest()[:16])
    )


def _c_files(names: list[str] | tuple[str, ...]) -> dict[str, bytes]:
    folder = resources.files(__package__) / "c"
    return {name: (folder / name).read_bytes() for name in names}


def _fingerprint(name: str, fmi: Fmi, compiler: compilers.Compiler) -> str:
    """A name for everything an FMU is made from; reading it needs no CasADi."""
    digest = hashlib.sha256(
        json.dumps(
            [
                name, fmi, compiler.command, compiler.identity, compilers.FLAGS,
                [metadata.version(package) for package in ("sblcosim", "casadi", "fmpy")],
            ]
        ).encode()
    )
    models, fmus = resources.files("sblcosim.models"), resources.files("sblcosim.fmus")
    for place in (models, models / module_of(name)[0], fmus, fmus / "c"):
        for file in _files(place):
            digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:32]


def _files(folder: Traversable) -> Iterator[Traversable]:
    for file in sorted(folder.iterdir(), key=lambda file: file.name):
        if file.name.endswith((".py", ".c", ".h", ".md", ".jinja")):
            yield file
