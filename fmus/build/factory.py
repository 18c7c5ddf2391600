"""From the name of a component to a finished FMU, built at most once."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache as remember
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path
from sblcosim.models import COMPONENTS, file_name
from sblcosim.models.declaration import Component

from .. import stopping, unchanged
from ..errors import BuildError, DamageWarning, nearest
from ..files import SEAL, intact, scratch, write_sealed
from ..platforms import WASM, suffix, this_platform
from ..standard import Fmi
from . import compiler as compilers
from .announcing import announced
from .c_files import HEADERS, LANES, SHARED, SHELLS, c_files
from .c_files import WASM as WASM_FILES
from .ingredients import ingredients

if TYPE_CHECKING:
    from sblcosim.models.equations import Model

CACHE_VARIABLE = "SBLCOSIM_CACHE"
"""Environment variable that names the folder for built FMUs, instead of the user's cache."""
USERS = "user-"
"""Prefix of folders in the cache that hold FMUs of users' receivers."""
READY = Path(__file__).parents[1] / "ready"
"""The folder for ready-made FMUs of a release, in folders named after their `key`."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """An FMU to build.

    Attributes
    ----------
    name
        A key of `sblcosim.models.COMPONENTS`.
    fmi
        Version of the standard, 2 or 3.
    all_platforms
        Whether it must run on all of `sblcosim.fmus.platforms.PLATFORMS`, or only on this one.
    baked
        The component's declaration with other start values and another default experiment. Such an
        FMU is for other tools: it has no engine for many simulations.
    constants
        Constants of the build that differ from the usual ones: ``{"beacons": 6}``.
    wasm
        Whether it also holds its engine as WebAssembly.
    """

    name: str
    fmi: Fmi = 2
    all_platforms: bool = False
    baked: Component | None = None
    constants: Mapping[str, int] = field(default_factory=dict)
    wasm: bool = False


def build(
    name: str,
    fmi: Fmi = 2,
    all_platforms: bool = False,
    baked: Component | None = None,
    **constants: int,
) -> Path:
    """Return the FMU of a component, built anew only if it has changed; see `build_all`."""
    return build_all([Wanted(name, fmi, all_platforms, baked, constants)])[0]


def build_all(wanted: Sequence[Wanted]) -> list[Path]:
    """Return FMUs of components; those that have changed are built anew, side by side.

    Standard error says which are being built.

    Returns
    -------
    list of Path
        Of each ``NAME.fmu``, or ``NAME6.fmu`` if a constant of the build is unusual: the one
        included in the package, or one in the user's cache, in a folder named after all its sources
        and tools.

    Raises
    ------
    BuildError
        There is no such component, it cannot be made for these constants, CasADi or a compiler is
        missing, or the compiler fails.
    """
    asked = [
        (w.name, w.fmi, w.all_platforms, w.wasm, repr(w.baked), *sorted(w.constants.items()))
        for w in wanted
    ]
    return unchanged.once(("build", *asked), lambda: _built(wanted))


def _built(wanted: Sequence[Wanted]) -> list[Path]:
    paths, missing = [], {}
    for each in wanted:
        path, ccs = _place_of(each)
        if ccs and not _usable(path):
            missing[path] = partial(_build_of, path, each, ccs)
        paths.append(path)
    _make(missing)
    return paths


def _place_of(wanted: Wanted) -> tuple[Path, Sequence[compilers.Compiler]]:
    """The path of an FMU, and the compilers that it needs: none if it is ready-made."""
    name, fmi, constants = wanted.name, wanted.fmi, wanted.constants
    if name not in COMPONENTS:
        raise BuildError(
            f"a component must be one of {', '.join(COMPONENTS)}; got {name!r}"
            f"{nearest(name, COMPONENTS)}"
        )
    if fmi not in SHELLS:
        raise BuildError(f"the FMI version must be 2 or 3, got {fmi!r}")
    try:
        file = f"{file_name(name, **constants)}.fmu"
    except ValueError as error:
        raise BuildError(str(error)) from None
    of = key(name, fmi, **constants)
    ready = _ready(of, file) if wanted.baked is None and not wanted.wasm else None
    if ready is not None:
        return ready, ()
    _versions()  # without CasADi, a compiler does not help
    ccs = compilers.for_every_platform() if wanted.all_platforms else (compilers.find(),)
    if wanted.wasm:
        ccs = (*ccs, compilers.for_platform(WASM))
    return cache() / _fingerprint(of, ccs, wanted.baked) / file, ccs


def kept_fmu(file: str, of: str, make: Callable[[], Model], fmi: Fmi) -> Path:
    """The FMU of a model that is not ours, for this machine; built anew only if it has changed.

    Parameters
    ----------
    of
        Cache key of everything that the model is made from. The model is made only if it must be
        compiled.

    Raises
    ------
    BuildError
        CasADi or a compiler is missing, or the compiler fails.
    """
    _versions()  # without CasADi, a compiler does not help
    ccs = (compilers.find(),)
    folder = f"{USERS}{_fingerprint(_digest([of, fmi]).hexdigest(), ccs)}"
    path = cache() / folder / file
    if not _usable(path):
        _make({path: lambda: _prepared(path, make(), fmi, ccs)})
    return path


@dataclass(frozen=True, slots=True)
class _Build:
    """An FMU to build: the objects to compile, and what makes it from them, by `_compiling`."""

    objects: Sequence[_Object]
    finish: Callable[[Callable[[_Object], bytes]], None]


def _make(builds: Mapping[Path, Callable[[], _Build]]) -> None:
    """Build FMUs by their paths, side by side; CasADi and the linker work in this thread."""
    if not builds:
        return
    for path in builds:
        _make_folder(path)
    prepared = [prepare() for prepare in builds.values()]
    objects = {each.identity: each for build in prepared for each in build.objects}
    missing = {
        known_as: each for known_as, each in objects.items()
        if each.kept is None or not _usable(each.kept)
    }
    texts = [each.sources for each in missing.values()]
    with announced([path.stem for path in builds], texts), _compiling(missing.values()) as compiled:

        def content(each: _Object) -> bytes:
            if each.kept is not None and (each.identity not in missing or intact(each.kept)):
                return each.kept.read_bytes()
            made = compiled(each)
            if each.kept is not None:
                with _caching():
                    write_sealed(each.kept, made)
            return made

        for build in prepared:
            build.finish(content)


def _build_of(path: Path, wanted: Wanted, ccs: Sequence[compilers.Compiler]) -> _Build:
    # CasADi and the XML are loaded only when something has to be built.
    from sblcosim.models.loading import load

    model = load(wanted.name, **wanted.constants)
    if wanted.baked is not None:
        model = replace(model, component=wanted.baked)
    return _prepared(path, model, wanted.fmi, ccs, lanes=wanted.baked is None)


def _prepared(
    path: Path, model: Model, fmi: Fmi, ccs: Sequence[compilers.Compiler], lanes: bool = True
) -> _Build:
    """The build of an FMU; equal models and compilers give equal bytes.

    Parameters
    ----------
    ccs
        A compiler for each platform.
    lanes
        Whether to include the engines for many simulations.
    """
    from .archive import contents, pack
    from .tables import tables_of, token_of

    engine = engine_sources(model)
    sources = {**engine, **c_files([SHELLS[fmi]])}
    token = token_of(model, sources, fmi)
    sources["tables.h"] = tables_of(model, token)
    objects = {
        cc: [
            *([_Object(sources, Unit(SHELLS[fmi], SHARED if lanes else ()), cc)]
              if cc.platform != WASM else []),
            *(_lanes(engine, cc) if lanes else ()),
        ]
        for cc in ccs
    }

    def finish(compiled: Callable[[_Object], bytes]) -> None:
        binaries = {cc.platform: _linked(map(compiled, own), cc) for cc, own in objects.items()}
        with _caching():
            write_sealed(path, pack(contents(model, fmi, token, sources, binaries)))

    return _Build([each for own in objects.values() for each in own], finish)


def _lanes(engine: Mapping[str, bytes], compiler: compilers.Compiler) -> list[_Object]:
    """The engines for many simulations; cached, because they take most of a build.

    They are the same for both versions of FMI and for all descriptions of the variables.
    """
    sources = {**engine, **c_files(LANES)}
    entry, alone = "dispatch.c", SHARED
    if compiler.platform == WASM:
        own = c_files(WASM_FILES)
        (entry, header), alone = WASM_FILES, ()
        sources |= {entry: own[entry], "string.h": own[header]}
    units = [Unit(entry), *lane_units("lanes.c", compiler.platform, alone)]
    return _kept(sources, units, compiler)


def _kept(
    sources: Mapping[str, bytes], units: Sequence[Unit], compiler: compilers.Compiler
) -> list[_Object]:
    """Objects that have a place in the cache."""
    facts = [compiler.command, compiler.identity, compiler.platform, SEAL]
    folder = cache() / key_of_sources(facts, units, sources)
    return [
        _Object(sources, unit, compiler, folder / f"{number}.o")
        for number, unit in enumerate(units)
    ]


def kept_module(
    file: str,
    of: str,
    parts: Callable[[], Iterable[tuple[Mapping[str, bytes], Unit]]],
    section: bytes,
) -> Path:
    """A module of WebAssembly from objects that are cached each; linked only if it has changed.

    One that the package includes is used as it is.

    Parameters
    ----------
    of
        Cache key of everything that the module is made from.
    parts
        The C sources of each object, by name, and what to compile of them.
    section
        A section of the module's format, to be its last.

    Raises
    ------
    BuildError
        CasADi or ``ziglang`` is missing, or the compiler fails.
    """
    ready = _ready(of, file)
    if ready is not None:
        return ready
    compiler = compilers.for_platform(WASM)
    path = cache() / _fingerprint(_digest([of, SEAL]).hexdigest(), (compiler,)) / file

    def prepared() -> _Build:
        objects = [each for sources, unit in parts() for each in _kept(sources, [unit], compiler)]

        def finish(compiled: Callable[[_Object], bytes]) -> None:
            binary = _linked(map(compiled, objects), compiler)
            with _caching():
                write_sealed(path, binary + section)

        return _Build(objects, finish)

    if not _usable(path):
        _make({path: prepared})
    return path


def _ready(of: str, file: str) -> Path | None:
    """A ready-made file from the same sources, unless a compiler is requested."""
    path = READY / of / file
    if not path.is_file() or os.environ.get(compilers.VARIABLE):
        return None
    if intact(path):
        return path
    _warn(f"{path}: must be as shipped with sblcosim, got other bytes; it is built instead, until "
          "it is installed again (pip install --force-reinstall --no-deps sblcosim)")
    return None


def _usable(path: Path) -> bool:
    """Whether a file is in the cache and unchanged."""
    if not path.is_file():
        return False
    if intact(path):
        return True
    _warn(f"{path}: must be as it was written, got other bytes; it is being built again")
    return False


def _warn(message: str) -> None:
    warnings.warn(message, DamageWarning, stacklevel=4)


def cache() -> Path:
    """The folder that holds built FMUs."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else user_cache_path("sblcosim") / "fmus"


def _make_folder(path: Path) -> None:
    """Make the folder of a file in the cache, before spending time on its content."""
    with _caching():
        path.parent.mkdir(parents=True, exist_ok=True)


@contextmanager
def _caching() -> Iterator[None]:
    """Explain the problem if the cache cannot be written to."""
    try:
        yield
    except OSError as error:
        raise BuildError(
            f"{CACHE_VARIABLE}: must be a writable folder, got {cache()} "
            f"({error.strerror or error})"
        ) from error


def engine_sources(model: Model) -> dict[str, bytes]:
    """The C sources of a component's equations and their engine, by file name."""
    from .generator import model_source

    return {**c_files(HEADERS), "model.h": model_source(model).encode()}


@dataclass(frozen=True, slots=True)
class Unit:
    """A source file to compile, perhaps one of several times with different flags."""

    source: str
    flags: tuple[str, ...] = ()


def lane_units(source: str, platform: str, alone: tuple[str, ...] = ()) -> tuple[Unit, ...]:
    """One build of a source for each useful number of lanes; `alone`: flags of that for one."""
    sets = {1: alone} if platform == WASM else {1: alone, 2: ()}
    if platform.startswith("x86_64-"):
        sets |= {4: ("-mavx2",), 8: ("-mavx512f", "-mavx512dq")}
    return tuple(Unit(source, (f"-DLANES={n}", *flags)) for n, flags in sets.items())


def library(
    name: str,
    sources: Mapping[str, bytes],
    lanes: bool = False,
    compiler: compilers.Compiler | None = None,
    platform: str | None = None,
) -> Path:
    """Return the shared library of ``NAME.c``, compiled anew only if it has changed.

    Parameters
    ----------
    sources
        All C files by name, including those that are only included.
    lanes
        Whether to compile it once per number of lanes.
    compiler
        By default one for the platform, unless the package includes the library.
    platform
        By default that of the compiler, or of this process; `WASM` makes WebAssembly.

    Raises
    ------
    BuildError
        There is no compiler, or it fails.
    """
    platform = platform or (this_platform() if compiler is None else compiler.platform)
    of = library_key(name, sources, lanes, platform)
    return kept_library(name, of, lambda: sources, lanes, compiler, platform=platform)


def kept_library(
    name: str,
    of: str,
    sources: Callable[[], Mapping[str, bytes]],
    lanes: bool,
    compiler: compilers.Compiler | None = None,
    generated: bool = False,
    platform: str | None = None,
) -> Path:
    """The same for sources that are identified by a key and made only if they must be compiled.

    Parameters
    ----------
    of
        Cache key of everything that the sources are made from, for the platform.
    generated
        Whether CasADi makes the sources; its version is then part of the key.
    """
    platform = platform or (this_platform() if compiler is None else compiler.platform)
    file = f"{name}{suffix(platform)}"
    ready = _ready(of, file) if compiler is None else None
    if ready is not None:
        return ready
    tools = _versions() if generated else []  # without CasADi, a compiler does not help
    compiler = compiler or (
        compilers.find() if platform == this_platform() else compilers.for_platform(platform)
    )
    facts = [of, compiler.command, compiler.identity, SEAL, *tools]
    path = cache() / _digest(facts).hexdigest()[:32] / file
    if not _usable(path):
        _make_folder(path)
        texts, units = sources(), library_units(name, lanes, platform)
        with announced([f"library {name}"], [texts] * len(units)):
            binary = compile_shared(texts, units, compiler)
        with _caching():
            write_sealed(path, binary)
    return path


def library_units(name: str, lanes: bool, platform: str) -> tuple[Unit, ...]:
    """The inputs of a library's compilation."""
    return lane_units(f"{name}.c", platform) if lanes else (Unit(f"{name}.c"),)


def compile_shared(
    sources: Mapping[str, bytes], units: Sequence[Unit], compiler: compilers.Compiler
) -> bytes:
    """Compile C sources into a shared library.

    Parameters
    ----------
    sources
        All files by name, including those that are only included.

    Raises
    ------
    BuildError
        The compiler fails.
    """
    objects = [_Object(sources, unit, compiler) for unit in units]
    with _compiling(objects) as compiled:
        return _linked(map(compiled, objects), compiler)


@dataclass(frozen=True, slots=True, eq=False)
class _Object:
    """An object to compile from C sources, all of them by name.

    Attributes
    ----------
    kept
        Place in the cache of one that several FMUs share.
    """

    sources: Mapping[str, bytes]
    unit: Unit
    compiler: compilers.Compiler
    kept: Path | None = None

    @property
    def identity(self) -> Hashable:
        return self.kept or self

    def compiled(self, folder: Path, include: Sequence[Path]) -> bytes:
        """Its bytes, made in a folder for temporary files."""
        with tempfile.TemporaryDirectory(dir=folder) as name:
            here = Path(name)
            for file, text in self.sources.items():
                (here / file).write_bytes(text)
            self.compiler.compile(self.unit.source, "object", include, self.unit.flags, here)
            return (here / "object").read_bytes()


@contextmanager
def _compiling(objects: Iterable[_Object]) -> Iterator[Callable[[_Object], bytes]]:
    """Compile objects on all processors, while the block works with those that are complete.

    Yields
    ------
    function
        Waits for an object. An error cancels those that have not begun.
    """
    folder, include = scratch(), [fmi_headers()]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        futures = {each.identity: pool.submit(each.compiled, folder, include) for each in objects}
        try:
            yield lambda each: stopping.result(futures[each.identity])
        finally:
            for future in futures.values():
                future.cancel()


def _linked(objects: Iterable[bytes], compiler: compilers.Compiler) -> bytes:
    """A shared library."""
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        names = []
        for number, content in enumerate(objects):
            names.append(f"{number}.o")
            (folder / names[-1]).write_bytes(content)
        compiler.link(names, "library", folder)
        return (folder / "library").read_bytes()


def fmi_headers() -> Path:
    """The folder with the FMI headers that come with FMPy."""
    import fmpy

    return Path(fmpy.__file__).parent / "c-code"


def key(name: str, fmi: Fmi, **constants: int) -> str:
    """Cache key of an FMU, made from its sources and the flags; needs no CasADi."""
    return _digest([name, fmi, ingredients(name, fmi, **constants)]).hexdigest()[:32]


def library_key(name: str, sources: Mapping[str, bytes], lanes: bool, platform: str) -> str:
    """Cache key of a `library`, made from its sources and the flags, without the compiler."""
    return key_of_sources([platform], library_units(name, lanes, platform), sources)


def key_of_sources(
    facts: Sequence[object], units: Sequence[Unit], sources: Mapping[str, bytes]
) -> str:
    """Cache key of the objects compiled from units of sources."""
    digest = _digest([*facts, [(unit.source, unit.flags) for unit in units]])
    for file in sorted(sources):
        digest.update(file.encode() + b"\0" + sources[file] + b"\0")
    return digest.hexdigest()[:32]


def _fingerprint(
    of: str, ccs: Sequence[compilers.Compiler], baked: Component | None = None
) -> str:
    """Cache key of an FMU, made from the `key` of its sources (`of`), the flags and the tools."""
    tools = [(cc.command, cc.identity, cc.platform) for cc in ccs]
    return _digest([of, tools, _versions(), repr(baked)]).hexdigest()[:32]


@remember
def _versions() -> list[str]:
    """Versions of the tools that make C from equations; a `BuildError` if they are missing."""
    try:
        return [metadata.version(package) for package in ("sblcosim", "casadi", "fmpy")]
    except metadata.PackageNotFoundError as error:
        why = f", as {compilers.VARIABLE} asks for" if os.environ.get(compilers.VARIABLE) else ""
        raise BuildError(
            f"building FMUs{why} needs the package {error.name}: pip install 'sblcosim[models]'"
        ) from None


def _digest(facts: object) -> hashlib._Hash:
    flags = [compilers.FLAGS, compilers.LINK_FLAGS]
    return hashlib.sha256(json.dumps([facts, flags]).encode())
