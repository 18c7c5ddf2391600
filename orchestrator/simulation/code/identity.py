"""Identity of Python code and values: a SHA-256 that is complete and the same everywhere.

A function is identified by its compiled code and by the values that it refers to: globals,
attributes of the user's modules, closures and defaults. A class is identified by its namespace,
bases and metaclass, an object by its class and state, a package by name and version. Neither
process nor folder matters: sets count without their order, and paths inside the folder of the code
are relative to it. Values that `pickle` cannot take apart, such as a lock, are refused with their
location. Annotations, texts and the order of definitions count if code reads them.

Not covered: data that the code reads, modules whose names it computes at run time, parts of an
object hidden from `pickle`, values put into packages, and random states of the process.
"""

from __future__ import annotations

import builtins
import os
import sys
import types
import warnings
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from ...errors import ConfigurationError, instance, quoted, shortened
from . import origins, taking_apart
from .encoding import Encoder, exactly
from .local_files import identity_of_module, identity_of_names
from .reads import HELD, Chains, asks, reads

_LONGEST = 200


class _RefusedError(Exception):
    """A value without a canonical representation."""

    def __init__(self, thing: object, path: Iterable[str], why: str = "") -> None:
        self.what, self.at, self.why = instance(thing), list(path), why


def identity(thing: Any, where: str, name: str) -> str:
    """SHA-256 of a function, class or object, and of everything it refers to.

    Raises
    ------
    ConfigurationError
        It refers to something that cannot be told from others of its kind; the message names it.
    """
    encoder = _Encoder([name])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about attributes that are only read here
            while encoder.started(thing).noticed != encoder.asked:
                encoder = _Encoder([name], asked=frozenset(encoder.noticed))
    except _RefusedError as error:
        at = shortened(" > ".join(error.at), _LONGEST)
        raise ConfigurationError(
            f"{where}: {name} must refer only to what can identify a run (code, values, arrays, "
            f"objects that can be pickled), got {error.what}{error.why} at {at}"
        ) from None
    except RecursionError:
        raise ConfigurationError(
            f"{where}: {name} must refer only to what can identify a run, got objects that are "
            "nested too deeply"
        ) from None
    return encoder.digest.hexdigest()


class _Encoder(Encoder):
    """Adds code and objects of the user too."""

    def started(self, thing: Any) -> _Encoder:
        """Add the root value."""
        self.folder = taking_apart.folder_of(thing)
        self.value(thing)
        return self

    # --- Values ----------------------------------------------------------------------------------

    def value(self, x: Any) -> None:
        """Add any value."""
        kind = type(x)
        if x is None or x is Ellipsis or x is NotImplemented or kind in (bool, int):
            self.put(kind.__name__, str(x) if kind is not int else f"{x:x}")
        elif kind is str:
            self.put("str", self._local(x))
        elif kind is bytes:
            self.put("bytes", x)
        elif kind is float:
            self.put("float", exactly(x))
        elif kind is complex:
            self.put("complex", exactly(x.real), exactly(x.imag))
        elif kind is tuple and not taking_apart.is_many(x):
            self.values("tuple", x)
        elif isinstance(x, types.CodeType):
            self.code(x)
        elif id(x) in self.seen:
            self.put("again", str(self.seen[id(x)]))
        elif isinstance(x, frozenset | set):
            self.set(x)
        else:
            self.seen[id(x)] = len(self.seen)
            self.kept.append(x)
            self.thing(x)

    def thing(self, x: Any) -> None:
        """Add a value that may be referenced more than once."""
        kind = type(x)
        if kind is list or kind is tuple:
            self.values(kind.__name__, x)
        elif kind in (dict, types.MappingProxyType, taking_apart.Unordered):
            self.dict(dict(x), kind is not taking_apart.Unordered)
        elif isinstance(x, np.ndarray):
            self.array(x)
        elif isinstance(x, np.void | np.longdouble | np.clongdouble):  # with padding bytes
            self.value(kind)
            self.array(np.asarray(x))
        elif isinstance(x, types.ModuleType):
            self.module(x, None)
        elif isinstance(x, types.FunctionType):
            self.function(x)
        elif isinstance(x, type):
            self.type(x)
        elif isinstance(x, types.CellType):
            self.cell(x, None)
        elif isinstance(x, types.BuiltinFunctionType):
            self.builtin(x)
        elif isinstance(x, PurePath):
            self.put("path", kind.__name__, self._local(str(x)))
        elif x is os.environ:
            self.put("environment")
        elif taking_apart.is_generator_of_all(x):
            self.put("generator of all", kind.__name__)
        elif not self.descriptor(x):
            self.object(x)

    # --- Code ------------------------------------------------------------------------------------

    def code(self, x: types.CodeType) -> None:
        """Add compiled code, independent of its location."""
        self.noticed |= asks(x)
        counts = (x.co_argcount, x.co_posonlyargcount, x.co_kwonlyargcount, x.co_flags)
        self.put("code", x.co_name, x.co_code, x.co_exceptiontable, str(counts))
        for names in (x.co_names, x.co_varnames, x.co_freevars, x.co_cellvars):
            self.put("names", *names)
        self.put("constants", str(len(x.co_consts)))
        for value in x.co_consts:
            if "__static_attributes__" in x.co_names and _are_texts(value):
                value = tuple(sorted(value))  # made from a set
            self.value(value)

    def function(self, x: types.FunctionType) -> None:
        """Add a function: its code and everything it refers to, or its name in a package."""
        name = str(x.__globals__.get("__name__", ""))
        given = x.__globals__.get("__file__")
        file = Path(given).absolute() if isinstance(given, str) else None
        package = origins.package_of(name, file)
        what = f"{name}.{x.__code__.co_qualname}"
        if package is not None:
            self.put("function", package, what)
            if "registry" in vars(x) and name == "functools":  # of singledispatch, with its cache
                self.dict(dict(vars(x)["registry"]), in_order=False)
            elif taking_apart.found(name, x.__code__.co_qualname) is not x:
                self.parts(x, {})
            return
        self.put("function")
        before, self.folder = self.folder, str(file.parent) if file is not None else ""
        read = reads(x.__code__)
        self.value(x.__code__)
        self.parts(x, read.chains)
        if "annotations" in self.asked:
            self.value(dict(x.__annotations__))
        self.globals(x.__globals__, read.globals, read.chains)
        imports = identity_of_names(read.imports, origins.package_in(x.__globals__))
        self.put("imports", repr(imports))
        self.loaded(read.imports, x.__globals__, read.chains)
        for text in sorted(read.named):
            if (module := origins.users_module(text)) is not None:
                self.module(module, None)
        if read.is_whole:
            self.all(x.__globals__)
        self.folder = before

    def parts(self, x: types.FunctionType, chains: Mapping[str, Chains]) -> None:
        """Add what a function holds: defaults, closure and attributes."""
        self.value(x.__defaults__)
        self.named("keywords", x.__kwdefaults__ or {})
        names = x.__code__.co_freevars
        self.put("closure", *names)
        for name, cell in zip(names, x.__closure__ or (), strict=True):
            with self.at(name):
                self.cell(cell, chains.get(name))
        self.named("attributes", vars(x))

    def cell(self, cell: types.CellType, chains: Chains | None) -> None:
        """Add the value of a closure."""
        try:
            value = cell.cell_contents
        except ValueError:
            self.put("empty")
            return
        self.used(value, chains)

    def globals(
        self, known: Mapping[str, Any], names: Iterable[str], chains: Mapping[str, Chains]
    ) -> None:
        """Add the globals that code reads."""
        for name in sorted(names):
            self.put("global", name)
            with self.at(name):
                if name in known:
                    self.used(known[name], chains.get(name))
                else:
                    self.put("builtin" if hasattr(builtins, name) else "missing")
                    if (value := taking_apart.builtin(name)) is not None:
                        self.value(value)

    def loaded(
        self, imports: Iterable[tuple[str, int, str]], known: Mapping[str, Any],
        chains: Mapping[str, Chains],
    ) -> None:  # fmt: skip
        """Add what code reads from modules that it imports itself, loaded or not."""
        package = origins.package_in(known)
        named = [(origins.absolute(n, level, package), v) for n, level, v in sorted(imports)]
        modules = {full: origins.users_module(full) for full, _ in named}
        for full, variable in named:
            found, module = origins.found(full), modules[full]
            if found is None or variable not in chains:
                continue
            parts = chains[variable]
            if variable.startswith(HELD):  # modules in it are variables
                parts = tuple(p for p in parts if origins.found(".".join((full, *p))) is None)
            with self.at(full):
                for some in [(p,) for p in parts] if variable.startswith(HELD) else [parts]:
                    if module is not None:
                        self.module(module, some)
                    elif not found[2]:
                        self.package(full, str(origins.package_of(full, found[0])), some)
                    else:
                        self.put("missing")

    def used(self, value: Any, chains: Chains | None) -> None:
        """Add a value; of a user's module, only the parts that are read."""
        if isinstance(value, types.ModuleType):
            self.module(value, chains)
        else:
            self.value(value)

    def module(self, x: types.ModuleType, chains: Chains | None) -> None:
        """Add a module: a package by name and version, a user's module by file and values.

        Parameters
        ----------
        chains
            Attributes that are read from it, such as ``(("part", "LIMIT"),)``; None: perhaps all.
        """
        package = origins.package_of_module(x)
        if package is not None:
            self.package(x.__name__, package, chains or ())
            return
        self.put("module", repr(identity_of_module(x)))
        if chains is None or () in chains or ("__dict__",) in chains:
            self.all(vars(x))
            return
        for chain in sorted(chains):
            self.put("read", *chain)
            self.read(x, chain)

    def all(self, known: Mapping[str, Any]) -> None:
        """Add all globals of a module, once."""
        if ("module", id(known)) not in self.kept:
            self.kept.append(("module", id(known)))
            self.named("all", {n: v for n, v in known.items() if not n.startswith("__")})

    def package(self, name: str, package: str, chains: Chains) -> None:
        """Add a module of a package, and the user's substitutions in the parts that are read."""
        self.put("package", name, package)
        for chain in sorted(chains):
            for thing in taking_apart.put_in(sys.modules.get(name), chain):
                with self.at(".".join(chain)):
                    self.value(thing)

    def read(self, module: types.ModuleType, chain: tuple[str, ...]) -> None:
        """Add the value of an attribute of a module, through modules inside modules."""
        first, *rest = chain
        with self.at(first):
            if first in vars(module):
                self.used(vars(module)[first], (tuple(rest),))
            else:
                self.put("missing")

    def type(self, x: type) -> None:
        """Add a class: its namespace, bases and metaclass, or its name in a package."""
        package = taking_apart.package_of_class(x)
        if package is not None:
            self.put("class", package, f"{x.__module__}.{x.__qualname__}")
            if users := taking_apart.put_in_class(x):
                self.named("put in", users)
            return
        self.put("class", x.__name__)
        before, self.folder = self.folder, taking_apart.folder_of(x) or self.folder
        module = sys.modules.get(str(x.__module__))
        if module is not None and not taking_apart.has_source(module):
            self.put("binary", repr(identity_of_module(module)))
        self.values("bases", x.__bases__)
        self.value(type(x))
        self.named("namespace", taking_apart.namespace(x))
        if also := taking_apart.asked_of(x, self.asked):
            self.named("asked", also)
        self.folder = before

    def builtin(self, x: types.BuiltinFunctionType) -> None:
        """Add a function of a C module, or a method of one of its objects."""
        owner = x.__self__
        self.put("builtin", x.__qualname__)
        if owner is None or isinstance(owner, types.ModuleType):
            module = sys.modules.get(x.__module__ or "")
            self.put("of", str(x.__module__), str(module and origins.package_of_module(module)))
            if module is not None and origins.package_of_module(module) is None:
                self.put("binary", repr(identity_of_module(module)))
        else:
            self.value(owner)

    def descriptor(self, x: Any) -> bool:
        """Add a wrapper of functions; False if it is not one."""
        parts = taking_apart.wrapped(x)
        if parts is None:
            return False
        self.values(type(x).__name__, parts)
        self.value(type(x))
        self.named("attributes", taking_apart.attributes(x))
        return True

    # --- Objects ---------------------------------------------------------------------------------

    def object(self, x: Any) -> None:
        """Add an object by its class and state, as `pickle` takes it apart."""
        try:
            parts = taking_apart.reduced(x)
        except Exception as error:
            why = "" if isinstance(error, TypeError) else f" ({shortened(str(error), 80)})"
            raise _RefusedError(x, self.path, why) from None
        self.put("object")
        self.value(type(x))
        if isinstance(parts, str):
            if not taking_apart.is_at(x, parts):
                raise _RefusedError(x, self.path, f", which no module has as {quoted(parts)},")
            self.put("named", parts)
            if taking_apart.is_users(x):
                self.state(object.__getstate__(x))
            return
        maker, given, state, items, pairs = parts
        with self.at(f"<{type(x).__name__}>"):
            self.value(maker)
            self.value(given)
            self.state(state)
            self.values("items", items or ())
            if isinstance(x, OrderedDict):
                self.values("pairs", pairs or ())
            else:
                self.dict(dict(pairs or ()))
            if also := taking_apart.beside(x):
                self.named("beside", also)

    def state(self, state: Any) -> None:
        """Add the state of an object, with the names of its attributes in messages."""
        if type(state) is dict and all(type(key) is str for key in state):
            self.named("state", state)
        else:
            self.value(state)


def _are_texts(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(part, str) for part in value)
