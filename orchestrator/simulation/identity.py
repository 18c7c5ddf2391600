"""What Python code and values are known by: a SHA-256 that is complete and the same everywhere.

Functions are known by their compiled code, and by the values that it refers to: globals, attributes
of the user's modules, closures and defaults. Classes are known by their namespaces, bases and
metaclasses, objects by their classes and states, packages by name and version. Neither process
nor folder matters: sets and dicts count without their order, and paths below the folder of the code
from there. What `pickle` cannot take apart, such as a lock, is refused with its place.

Not seen are names that are made while the code runs (`eval`, `globals()`), and data that it reads.
"""

from __future__ import annotations

import builtins
import hashlib
import os
import struct
import sys
import types
import warnings
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from ..errors import ConfigurationError, instance, shortened
from . import origins, taking_apart
from .code_reads import HELD, Chains, reads
from .local_files import identity_of_module, identity_of_names

_LONGEST = 200


class _RefusedError(Exception):
    """A value that nothing canonical stands for."""

    def __init__(self, thing: object, path: Iterable[str], why: str = "") -> None:
        self.what, self.at, self.why = instance(thing), list(path), why


def identity(thing: Any, where: str, name: str) -> str:
    """SHA-256 of a function, class or object, and of all that it refers to.

    Raises
    ------
    ConfigurationError
        It refers to something that cannot be told from another of its kind; the message names it.
    """
    encoder = _Encoder([name])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that are read here only
            encoder.value(thing)
    except _RefusedError as error:
        at = shortened(" > ".join(error.at), _LONGEST)
        raise ConfigurationError(
            f"{where}: {name} must refer only to what a run can be known by (code, values, arrays, "
            f"objects that can be pickled), got {error.what}{error.why} at {at}"
        ) from None
    except RecursionError:
        raise ConfigurationError(
            f"{where}: {name} must refer only to what a run can be known by, got objects that are "
            "nested too deeply"
        ) from None
    return encoder.digest.hexdigest()


class _Encoder:
    """Feeds a hash with what a value is; an object that is met again is the number it had."""

    def __init__(self, path: list[str], folder: str = "", sets: tuple[int, ...] = ()) -> None:
        self.digest = hashlib.sha256()
        self.path = path
        self.folder = folder  # of the code that is looked at
        self.sets = sets  # whose members are looked at
        self.seen: dict[int, int] = {}
        self.kept: list[Any] = []  # so that no other object gets the same id

    # --- Parts -----------------------------------------------------------------------------------

    def put(self, kind: str, *texts: str | bytes) -> None:
        """Add some texts."""
        for text in (kind, *texts):
            raw = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
            self.digest.update(struct.pack("<Q", len(raw)) + raw)

    @contextmanager
    def at(self, crumb: str) -> Iterator[None]:
        """Where it is, for messages."""
        self.path.append(crumb)
        yield
        self.path.pop()  # kept when something is refused

    def values(self, kind: str, values: Iterable[Any]) -> None:
        """Add values in their order."""
        listed = list(values)
        self.put(kind, str(len(listed)))
        for i, value in enumerate(listed):
            with self.at(f"[{i}]"):
                self.value(value)

    def named(self, kind: str, values: Mapping[str, Any]) -> None:
        """Add values by their names."""
        self.put(kind, str(len(values)))
        for name in sorted(values):
            self.put("name", name)
            with self.at(name):
                self.value(values[name])

    def apart(self, value: Any, inside: int = 0) -> bytes:
        """A hash of a value by itself, for things without an order."""
        if isinstance(value, str) and type(value) is str:
            return b"str" + self._local(value).encode("utf-8", "surrogatepass")
        other = _Encoder(self.path, self.folder, (*self.sets, inside) if inside else self.sets)
        other.value(value)
        return other.digest.digest()

    def _local(self, text: str) -> str:
        """A text without the folder of the code, if it is a path in it."""
        if self.folder and text.startswith(self.folder):
            rest = text[len(self.folder) :]
            if not rest or rest.startswith(os.sep):
                return f"\0folder{rest}"
        return text

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
            self.put("float", x.hex())
        elif kind is complex:
            self.put("complex", x.real.hex(), x.imag.hex())
        elif kind is tuple:
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
        """Add a value that may be referred to more than once."""
        kind = type(x)
        if kind is list:
            self.values("list", x)
        elif kind is dict or kind is types.MappingProxyType:
            self.dict(dict(x))
        elif isinstance(x, np.ndarray):
            self.array(x)
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
        elif not self.descriptor(x):
            self.object(x)

    def set(self, x: Any) -> None:
        """Add a set, in no order."""
        if id(x) in self.sets:
            self.put("set above", str(len(self.sets) - self.sets.index(id(x))))
            return
        self.put("set", str(len(x)))
        if type(x) not in (set, frozenset):
            self.value(type(x))
            self.value(getattr(x, "__dict__", None))
        for part in sorted(self.apart(item, id(x)) for item in x):
            self.put("item", part)

    def dict(self, x: Mapping[Any, Any]) -> None:
        """Add a dict by its keys, in no order."""
        self.put("dict", str(len(x)))
        items = sorted(((self.apart(key), key) for key in x), key=lambda item: item[0])
        for part, key in items:
            self.put("key", part)
            with self.at(_shown(key)):
                self.value(x[key])

    def array(self, x: np.ndarray[Any, Any]) -> None:
        """Add an array: type, shape, and values in the order of C."""
        self.put("array", x.dtype.str, str(x.shape))
        if type(x) is not np.ndarray:
            self.value(type(x))
            self.value(getattr(x, "__dict__", None))
            if isinstance(x, np.ma.MaskedArray):
                self.value(np.ma.getmaskarray(x))
        plain = np.asarray(x)
        if plain.dtype.names:  # between the fields may be anything
            self.named("fields", {name: plain[name] for name in plain.dtype.names})
        elif plain.dtype.hasobject:
            self.values("items", plain.ravel().tolist())
        else:
            self.put("data", plain.tobytes())

    # --- Code ------------------------------------------------------------------------------------

    def code(self, x: types.CodeType) -> None:
        """Add compiled code, without where it stands."""
        counts = (x.co_argcount, x.co_posonlyargcount, x.co_kwonlyargcount, x.co_flags)
        self.put("code", x.co_name, x.co_code, x.co_exceptiontable, str(counts))
        for names in (x.co_names, x.co_varnames, x.co_freevars, x.co_cellvars):
            self.put("names", *names)
        self.put("constants", str(len(x.co_consts)))
        for value in x.co_consts:
            if "__static_attributes__" in x.co_names and _are_texts(value):
                value = tuple(sorted(value))  # made of a set
            self.value(value)

    def function(self, x: types.FunctionType) -> None:
        """Add a function: its code and all that this refers to, or its name in a package."""
        name = str(x.__globals__.get("__name__", ""))
        given = x.__globals__.get("__file__")
        file = Path(given).absolute() if isinstance(given, str) else None
        package = origins.package_of(name, file)
        what = f"{name}.{x.__code__.co_qualname}"
        if package is not None:
            self.put("function", package, what)
            if "registry" in vars(x) and name == "functools":  # of singledispatch, with its cache
                self.dict(dict(vars(x)["registry"]))
            elif taking_apart.found(name, x.__code__.co_qualname) is not x:
                self.parts(x, {})
            return
        self.put("function")
        before, self.folder = self.folder, str(file.parent) if file is not None else ""
        read = reads(x.__code__)
        self.value(x.__code__)
        self.parts(x, read.chains)
        self.globals(x.__globals__, read.globals, read.chains)
        imports = identity_of_names(read.imports, origins.package_in(x.__globals__))
        self.put("imports", repr(imports))
        self.loaded(read.imports, x.__globals__, read.chains)
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

    def loaded(
        self, imports: Iterable[tuple[str, int, str]], known: Mapping[str, Any],
        chains: Mapping[str, Chains],
    ) -> None:  # fmt: skip
        """Add what code reads of modules that it imports itself, if they are loaded."""
        for name, level, variable in sorted(imports):
            full = origins.absolute(name, level, origins.package_in(known))
            module = sys.modules.get(full)
            if module is None or variable not in chains:
                continue
            with self.at(full):
                if not variable.startswith(HELD):
                    self.module(module, chains[variable])
                    continue
                for (part,) in chains[variable]:  # modules among them are variables
                    if not isinstance(vars(module).get(part), types.ModuleType):
                        self.module(module, ((part,),))

    def used(self, value: Any, chains: Chains | None) -> None:
        """Add a value; of a module of the user only what is read of it."""
        if isinstance(value, types.ModuleType):
            self.module(value, chains)
        else:
            self.value(value)

    def module(self, x: types.ModuleType, chains: Chains | None) -> None:
        """Add a module: a package by name and version, one of the user by file and values.

        Parameters
        ----------
        chains
            Attributes that are read of it, such as ``(("part", "LIMIT"),)``; None: perhaps all.
        """
        package = origins.package_of_module(x)
        if package is not None:
            self.put("package", x.__name__, package)
            return
        self.put("module", repr(identity_of_module(x)))
        if chains is None or () in chains:
            if ("module", id(x)) not in self.kept:
                self.kept.append(("module", id(x)))
                names = {n: v for n, v in vars(x).items() if not n.startswith("__")}
                self.named("all", names)
            return
        for chain in sorted(chains):
            self.put("read", *chain)
            self.read(x, chain)

    def read(self, module: types.ModuleType, chain: tuple[str, ...]) -> None:
        """Add what an attribute of a module has as value, through modules in modules."""
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
            return
        self.put("class", x.__name__)
        module = sys.modules.get(str(x.__module__))
        if module is not None and not taking_apart.has_source(module):
            self.put("binary", repr(identity_of_module(module)))
        self.values("bases", x.__bases__)
        self.value(type(x))
        self.named("namespace", taking_apart.namespace(x))

    def builtin(self, x: types.BuiltinFunctionType) -> None:
        """Add a function of a module in C, or a method of one of its objects."""
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
        """Add what wraps functions; False if it is no such thing."""
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
            self.put("named", parts)
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

    def state(self, state: Any) -> None:
        """Add the state of an object, with the names of its attributes in messages."""
        if type(state) is dict and all(type(key) is str for key in state):
            self.named("state", state)
        else:
            self.value(state)


def _are_texts(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(part, str) for part in value)


def _shown(key: object) -> str:
    return f"[{shortened(key if isinstance(key, str) else repr(key), 40)}]"
