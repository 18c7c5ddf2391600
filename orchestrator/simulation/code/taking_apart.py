"""Parts of classes, descriptors and objects, for their identity."""

from __future__ import annotations

import _abc  # type: ignore[import-not-found]
import abc
import builtins
import copyreg
import ctypes
import enum
import functools
import inspect
import itertools
import random
import sys
import types
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from . import origins

_UNSAID = {
    "__dict__", "__weakref__", "__module__", "__qualname__", "__doc__", "__firstlineno__",
    "__static_attributes__", "__classcell__", "_abc_impl", "__pydantic_core_schema__",
    "__pydantic_validator__", "__pydantic_serializer__", "__pydantic_parent_namespace__",
}  # fmt: skip
"""Entries of a class that do not affect its behaviour, or differ between processes."""
_COPIED = {
    *functools.WRAPPER_ASSIGNMENTS, "__wrapped__", "cache_parameters", "func", "attrname", "lock",
}  # fmt: skip
"""Attributes that a descriptor takes from its function."""
_MEMBERS = (types.MemberDescriptorType, types.GetSetDescriptorType)
_SLOTS = (
    types.WrapperDescriptorType, types.MethodDescriptorType, types.ClassMethodDescriptorType,
    types.MethodWrapperType,
)  # fmt: skip
_REFUSED = (
    *(t for t in vars(itertools).values() if isinstance(t, type)), ctypes.CDLL, ctypes.c_void_p
)  # fmt: skip
"""Types that `pickle` takes apart differently by version of Python, or into addresses."""
_PYDANTIC = "pydantic._internal._decorators"
_VALUES = (int, float, complex, str, bytes, tuple, list, dict, set)
_MANY = 10_000
_TYPE_VARIABLES = (TypeVar, ParamSpec)
_HEAP = 1 << 9  # Py_TPFLAGS_HEAPTYPE


def package_of_class(kind: type) -> str | None:
    """Identity of the package in which a class is found by its name; None: there is none."""
    name = str(kind.__module__)
    module = sys.modules.get(name)
    package = (
        origins.package_of_module(module) if module is not None else origins.package_of(name, None)
    )
    static = not kind.__flags__ & _HEAP  # in C, perhaps without an importable name
    return package if static or found(name, kind.__qualname__) is kind else None


def found(module: str, name: str) -> Any:
    """The object with a dotted name in a module; None if there is none."""
    thing: Any = sys.modules.get(module)
    for part in name.split("."):
        thing = inspect.getattr_static(thing, part, None)
    return thing


def has_source(module: types.ModuleType) -> bool:
    """Whether a module may be written in Python."""
    file = origins.file_of(module)
    return file is None or file.suffix in ("", ".py", ".pyw")


def is_users(thing: Any) -> bool:
    """Whether a function or class, or an object's class, is certainly the user's."""
    if isinstance(thing, types.FunctionType):
        name, file = thing.__globals__.get("__name__"), thing.__globals__.get("__file__")
    else:
        kind = thing if isinstance(thing, type) else type(thing)
        name = str(kind.__module__)
        file = getattr(sys.modules.get(name), "__file__", None)
    if not isinstance(file, str):
        return name == "__main__"
    return origins.package_of(str(name), Path(file).absolute()) is None


def put_in(module: types.ModuleType | None, chain: Iterable[str]) -> Iterator[Any]:
    """The user's replacements for attributes of a package."""
    thing: Any = module
    for part in chain:
        thing = inspect.getattr_static(thing, part, None)
        if is_users(thing):
            yield thing
            return


def put_in_class(kind: type) -> dict[str, Any]:
    """The user's functions and classes in a class of a package."""
    return {
        f"{number} {name}": value
        for number, base in enumerate(kind.__mro__)
        for name, value in vars(base).items()
        if isinstance(value, types.FunctionType | type) and is_users(value)
    }


def builtin(name: str) -> Any:
    """The user's replacement for a builtin; None if it is original."""
    value = vars(builtins).get(name)
    plain = isinstance(value, _VALUES) and not name.startswith("__")
    return value if plain or is_users(value) else None


def folder_of(thing: Any) -> str:
    """The folder of a user's code; empty if there is none."""
    while isinstance(thing, functools.partial | types.MethodType):
        thing = thing.func if isinstance(thing, functools.partial) else thing.__func__
    if not is_users(thing):
        return ""
    if isinstance(thing, types.FunctionType):
        file = thing.__globals__.get("__file__")
    else:
        kind = thing if isinstance(thing, type) else type(thing)
        file = getattr(sys.modules.get(str(kind.__module__)), "__file__", None)
    return str(Path(file).absolute().parent) if isinstance(file, str) else ""


def asked_of(kind: type, asked: Collection[str]) -> dict[str, Any]:
    """Parts of a class that count if they exist, or only if code reads them."""
    found: dict[str, Any] = {}
    if isinstance(kind, abc.ABCMeta):
        told = [k for k in (reference() for reference in _abc._get_dump(kind)[0]) if k is not None]
        if told:
            found["registered"] = sorted(told, key=lambda k: (k.__module__, k.__qualname__))
    if "annotations" in asked:
        found["annotations"] = dict(inspect.get_annotations(kind))
    if "texts" in asked:
        found["text"] = vars(kind).get("__doc__")
    if "subclasses" in asked:
        found["subclasses"] = type.__subclasses__(kind)
    return found


def is_generator_of_all(thing: Any) -> bool:
    """Whether it is a random generator that all code of the process shares."""
    return thing is random._inst or thing is np.random.mtrand._rand


class Unordered(dict[Any, Any]):
    """A dict whose order is meaningless, or that other entries of a class determine."""


def held(thing: Any) -> Unordered | None:
    """Attributes of an object; None if it has none."""
    found = getattr(thing, "__dict__", None)
    return None if found is None else Unordered(found)


def namespace(kind: type) -> dict[str, Any]:
    """The entries of a class that determine its behaviour."""
    found = {
        name: value
        for name, value in vars(kind).items()
        if name not in _UNSAID
        and not name.startswith(("__annot", "__conditional_annot"))
        and not (isinstance(value, _MEMBERS) and value.__objclass__ is kind)
    }
    said = {"_field_defaults", "_member_map_", "_value2member_map_"}
    if found.get("__match_args__") == tuple(found.get("__dataclass_fields__", ())):
        said.add("__dataclass_fields__")
    return found | {name: Unordered(found[name]) for name in sorted(said & set(found))}


def wrapped(thing: Any) -> tuple[Any, ...] | None:
    """What a C descriptor or wrapper holds; None if it is not one."""
    if isinstance(thing, property):
        return thing.fget, thing.fset, thing.fdel
    if isinstance(thing, staticmethod | classmethod):
        return (thing.__func__,)
    if isinstance(thing, functools.cached_property):
        return thing.func, thing.attrname
    if isinstance(thing, types.MethodType):
        return thing.__func__, thing.__self__
    if isinstance(thing, functools._lru_cache_wrapper):
        return thing.__wrapped__, thing.cache_parameters()
    if isinstance(thing, (*_MEMBERS, *_SLOTS)):
        owner = getattr(thing, "__objclass__", None)
        return thing.__name__, owner, getattr(thing, "__self__", None)
    return None


def attributes(thing: Any) -> dict[str, Any]:
    """Attributes of a descriptor that do not come from its function."""
    return {k: v for k, v in getattr(thing, "__dict__", {}).items() if k not in _COPIED}


def is_many(value: tuple[Any, ...]) -> bool:
    """Whether a tuple is so large that repeated occurrences must not be written again."""
    known: dict[int, int] = {}

    def count(of: tuple[Any, ...]) -> int:
        if id(of) not in known:
            known[id(of)] = 1 + sum(count(part) for part in of if type(part) is tuple)
        return known[id(of)]

    return count(value) > _MANY


def content(array: np.ndarray[Any, Any]) -> bytes:
    """The values of an array without objects and fields, in C order, without padding."""
    if array.dtype.char not in "gG" or np.finfo(np.longdouble).nmant != 63:
        return array.tobytes()
    plain = np.array(array, array.dtype.newbyteorder("="), order="C").ravel().view(np.longdouble)
    return plain.view(np.uint8).reshape(len(plain), -1)[:, :10].tobytes()


def beside(thing: Any) -> dict[str, Any]:
    """Attributes of an enumeration member beyond its value."""
    if not isinstance(thing, enum.Enum):
        return {}
    return {k: v for k, v in vars(thing).items() if not (k[0] == "_" == k[-1])}


def is_at(thing: Any, name: str) -> bool:
    """Whether a name in any module refers to this object."""
    first, _, rest = name.partition(".")
    for module in [*sys.modules.values()]:
        there = getattr(module, "__dict__", {}).get(first)
        with suppress(Exception):  # modules may hold anything
            if there is not None and (attrgetter(rest)(there) if rest else there) is thing:
                return True
    return isinstance(thing, _TYPE_VARIABLES)


def reduced(thing: Any) -> str | tuple[Any, ...]:
    """An object as `pickle` takes it apart: a name, or maker, arguments, state, items and pairs.

    Raises
    ------
    Exception
        Of any type, if that is impossible.
    """
    if isinstance(thing, _REFUSED):
        raise TypeError
    special = copyreg.dispatch_table.get(type(thing))
    parts: Any = special(thing) if special is not None else thing.__reduce_ex__(4)
    if isinstance(parts, str):
        return parts
    maker, given, state, items, pairs = (*parts, None, None, None)[:5]
    if type(state) is tuple and all(type(part) in (dict, types.NoneType) for part in state):
        # The entries of slots, and those of `__dict__` before them.
        address = {"cls_ref"} if type(thing).__module__ == _PYDANTIC else set()
        state = tuple(
            part and Unordered({k: v for k, v in part.items() if k not in address})
            for part in state
        )
    return maker, given, state, items, pairs
