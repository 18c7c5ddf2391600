"""What classes, descriptors and objects consist of, for their identity."""

from __future__ import annotations

import copyreg
import ctypes
import functools
import inspect
import itertools
import sys
import types
from typing import Any

from . import origins

_UNSAID = {
    "__dict__", "__weakref__", "__module__", "__qualname__", "__doc__", "__firstlineno__",
    "__static_attributes__", "__classcell__", "_abc_impl",
}  # fmt: skip
"""Entries of a class that say nothing of what it does, or differ from process to process."""
_COPIED = {
    *functools.WRAPPER_ASSIGNMENTS, "__wrapped__", "cache_parameters", "func", "attrname", "lock",
}  # fmt: skip
"""Attributes of a descriptor that it has from its function."""
_MEMBERS = (types.MemberDescriptorType, types.GetSetDescriptorType)
_SLOTS = (
    types.WrapperDescriptorType, types.MethodDescriptorType, types.ClassMethodDescriptorType,
    types.MethodWrapperType,
)  # fmt: skip
_REFUSED = (
    *(t for t in vars(itertools).values() if isinstance(t, type)), ctypes.CDLL, ctypes.c_void_p
)  # fmt: skip
"""What `pickle` takes apart, in some versions of Python or into addresses."""
_HEAP = 1 << 9  # Py_TPFLAGS_HEAPTYPE


def package_of_class(kind: type) -> str | None:
    """The package in which a class is found by its name, as it is known; None: there is none."""
    name = str(kind.__module__)
    module = sys.modules.get(name)
    package = (
        origins.package_of_module(module) if module is not None else origins.package_of(name, None)
    )
    static = not kind.__flags__ & _HEAP  # in C, perhaps without a name that can be imported
    return package if static or found(name, kind.__qualname__) is kind else None


def found(module: str, name: str) -> Any:
    """What a module has by a dotted name; None if there is none."""
    thing: Any = sys.modules.get(module)
    for part in name.split("."):
        thing = inspect.getattr_static(thing, part, None)
    return thing


def has_source(module: types.ModuleType) -> bool:
    """Whether a module may be Python."""
    file = origins.file_of(module)
    return file is None or file.suffix in ("", ".py", ".pyw")


def namespace(kind: type) -> dict[str, Any]:
    """The entries of a class that say what it does."""
    return {
        name: value
        for name, value in vars(kind).items()
        if name not in _UNSAID
        and not name.startswith(("__annot", "__conditional_annot"))
        and not (isinstance(value, _MEMBERS) and value.__objclass__ is kind)
    }


def wrapped(thing: Any) -> tuple[Any, ...] | None:
    """What a descriptor or wrapper in C holds; None if it is no such thing."""
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
    """Attributes of a descriptor that it does not have from its function."""
    return {k: v for k, v in getattr(thing, "__dict__", {}).items() if k not in _COPIED}


def reduced(thing: Any) -> str | tuple[Any, ...]:
    """An object as `pickle` takes it apart: a name, or maker, arguments, state, items and pairs.

    Raises
    ------
    Exception
        Of any type, if that cannot be done.
    """
    if isinstance(thing, _REFUSED):
        raise TypeError
    special = copyreg.dispatch_table.get(type(thing))
    parts: Any = special(thing) if special is not None else thing.__reduce_ex__(4)
    if isinstance(parts, str):
        return parts
    return (*parts, None, None, None)[:5]
