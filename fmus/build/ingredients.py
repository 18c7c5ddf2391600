"""Hash of an FMU's ingredients: a changed model changes its own FMU and no other.

A component's sources are its module of equations and the modules that it imports, according to the
import statements; in a folder inside a component's folder, all modules. Reading them needs no
CasADi. A module of declarations (``variables``) counts only by the names taken from it, so that the
declaration of one receiver is not an ingredient of the others.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module, resources
from importlib.resources.abc import Traversable

from sblcosim.models import declared, module_of

from ..standard import Fmi
from .c_files import LANES, SHELLS, WASM, c_files, engine_headers

_MODELS, _FMUS = "sblcosim.models", "sblcosim.fmus"
_BUILD = f"{_FMUS}.build"
_NO_INGREDIENTS = (
    f"{_FMUS}.files", f"{_BUILD}.announcing", f"{_BUILD}.bound", f"{_BUILD}.bound_source",
    f"{_BUILD}.modules", f"{_BUILD}.ours",
)
"""Modules that do not affect an FMU: files only writes what is complete, announcing only tells,
bounds and modules of several components are in no FMU, and ours only asks whether an existing file
was built here."""
_RECEIVERS = "receiver"
_AFTER = re.compile(r"<!-- after (\w+\.md) -->")
"""What a page says that presumes another one."""
_DECLARATIONS = "variables"
"""Name of the modules that hold a folder's declarations."""


@dataclass(frozen=True, slots=True)
class Import:
    """A name that a module imports from another one; without a name, the module itself."""

    module: str
    name: str = ""


@cache
def ingredients(name: str, fmi: Fmi, **constants: int) -> str:
    """Hash of all ingredients of a component's FMU except the tools; computed once.

    Parameters
    ----------
    name
        A key of `sblcosim.models.COMPONENTS`.
    """
    folder, module = module_of(name)
    symbols = resources.files(_MODELS) / "SYMBOLS.md"
    return _ingredients(
        repr(declared(name, **constants)), (f"{_MODELS}.{folder}.{module}",), fmi,
        {**pages(name), symbols.name: symbols.read_bytes()},
    )


def pages(name: str) -> dict[str, bytes]:
    """The files that are written about a component: the folder's, and the component's own."""
    folder = resources.files(f"{_MODELS}.{module_of(name)[0]}")
    found: dict[str, bytes] = {}
    for page in ("README.md", f"{name}.md"):
        if folder.joinpath(page).is_file():
            content = folder.joinpath(page).read_bytes()
            for other in _AFTER.findall(content.decode("utf-8")):
                found[other] = folder.joinpath(other).read_bytes()
            found[page] = content
    return found


@cache
def of_user(identity: str, fmi: Fmi) -> str:
    """The same for a component of others, which may use any part of our receivers.

    Parameters
    ----------
    identity
        Identity of the component itself.
    """
    folder = resources.files(f"{_MODELS}.{_RECEIVERS}")
    names = sorted(file.name for file in folder.iterdir() if file.name.endswith(".py"))
    roots = tuple(f"{_MODELS}.{_RECEIVERS}.{name.removesuffix('.py')}" for name in names)
    return _ingredients(identity, roots, fmi, {})


def _ingredients(declared: str, roots: tuple[str, ...], fmi: Fmi, files: dict[str, bytes]) -> str:
    digest = hashlib.sha256(declared.encode())
    for part in _closure((*_build_modules(), *roots)):
        digest.update(part.encode() + b"\0")
    files |= c_files([SHELLS[fmi], *LANES, *WASM]) | engine_headers()
    for file in resources.files(_BUILD).iterdir():
        if file.name.endswith(".jinja"):
            files[file.name] = file.read_bytes()
    for label in sorted(files):
        digest.update(label.encode() + b"\0" + files[label] + b"\0")
    return digest.hexdigest()


@cache
def of_module(name: str, files: tuple[str, ...]) -> str:
    """Hash of one of our modules with everything that it imports, and of C files."""
    digest = hashlib.sha256()
    for part in _closure((name,), ()):
        digest.update(part.encode() + b"\0")
    for label, content in sorted(c_files(files).items()):
        digest.update(label.encode() + b"\0" + content + b"\0")
    return digest.hexdigest()


def _closure(
    roots: tuple[str, ...], without: tuple[str, ...] = _NO_INGREDIENTS
) -> list[str]:
    """Our modules and their imports, each as a text that changes with it."""
    parts: dict[str, str] = {}
    waiting = [Import(root) for root in roots]
    while waiting:
        wanted = waiting.pop()
        value = _declared(wanted)
        label = f"{wanted.module}.{wanted.name}" if value else wanted.module
        if label in parts or wanted.module in without:
            continue
        if found := _found(wanted.module):
            waiting += found
            continue
        parts[label] = value or _source(wanted.module)
        if not value:
            waiting += _imports(wanted.module)
    return [f"{label}\0{parts[label]}" for label in sorted(parts)]


def _declared(wanted: Import) -> str:
    """The value of a name taken from declarations, if its ``repr`` is complete."""
    if not wanted.name or wanted.module.rpartition(".")[2] != _DECLARATIONS:
        return ""
    value = getattr(import_module(wanted.module), wanted.name)
    return repr(value) if _is_plain(value) else ""


def _is_plain(value: object) -> bool:
    """Whether the ``repr`` of a value is complete."""
    if isinstance(value, dict):
        return all(map(_is_plain, (*value, *value.values())))
    if isinstance(value, tuple | list):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)


@cache
def _build_modules() -> tuple[str, ...]:
    names = sorted(file.name for file in resources.files(_BUILD).iterdir())
    return tuple(
        f"{_BUILD}.{name.removesuffix('.py')}"
        for name in names
        if name.endswith(".py") and name != "__init__.py"
    )


@cache
def _source(module: str) -> str:
    """The source of a module, read once: it has been or will be imported."""
    return _file(module).read_text("utf-8")


@cache
def _imports(module: str) -> tuple[Import, ...]:
    """Imports of a module from our modules, at any place in the module."""
    return tuple(
        wanted
        for match in _IMPORT.finditer(_source(module))
        for wanted in _imported(module, match)
        if wanted.module.startswith((f"{_MODELS}.", f"{_FMUS}.")) and _is_there(wanted.module)
    )


@cache
def _is_there(module: str) -> bool:
    return _file(module).is_file() or bool(_found(module))


@cache
def _found(package: str) -> tuple[Import, ...]:
    """The modules of a folder inside a component's folder: they are found, not listed."""
    component, _, inner = package.removeprefix(f"{_MODELS}.").partition(".")
    folder = _root(_MODELS).joinpath(component, *inner.split("."))
    if not package.startswith(f"{_MODELS}.") or not inner or not folder.is_dir():
        return ()
    names = sorted(file.name for file in folder.iterdir())
    return tuple(
        Import(f"{package}.{name.removesuffix('.py')}") for name in names if name.endswith(".py")
    )


_IMPORT = re.compile(
    r"(?:^|[:;])[ \t]*(?:from[ \t]+(?P<dots>\.*)(?P<origin>[\w.]*)[ \t]+)?"
    r"import[ \t]+(?:\((?P<many>[^)]*)\)|(?P<few>[^\n(;]+))",
    re.MULTILINE,
)
"""An import statement. Searching the text takes a tenth of the time of parsing it."""


def _imported(module: str, statement: re.Match[str]) -> Iterator[Import]:
    listed = re.sub(r"#[^\n]*", "", statement["many"] or statement["few"])
    names = [entry.split()[0] for entry in listed.split(",") if entry.strip()]
    if statement["origin"] is None:
        yield from map(Import, names)
        return
    level = len(statement["dots"])
    parents = module.split(".")[:-level] if level else []
    origin = ".".join([*parents, *filter(None, [statement["origin"]])])
    for name in names:
        # A name is a module of the package, or something in the module named first.
        yield Import(f"{origin}.{name}")
        yield Import(origin, name)


@cache
def _file(module: str) -> Traversable:
    """The file of a module. A package has none: `sblcosim.models` lists all components."""
    for package in (_MODELS, _FMUS):
        if module.startswith(f"{package}."):
            *folders, name = module.removeprefix(f"{package}.").split(".")
            return _root(package).joinpath(*folders, f"{name}.py")
    raise ValueError(f"{module}: must be a module of {_MODELS} or {_FMUS}")


@cache
def _root(package: str) -> Traversable:
    return resources.files(package)
