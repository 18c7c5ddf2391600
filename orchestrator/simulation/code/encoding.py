"""Hashes of plain values and containers, the same in every process and folder."""

from __future__ import annotations

import hashlib
import os
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...errors import shortened
from . import taking_apart


class Encoder(ABC):
    """Feeds a value into a hash. An object that appears again is represented by its number."""

    def __init__(self, path: list[str], asked: frozenset[str] = frozenset()) -> None:
        self.digest = hashlib.sha256()
        self.path = path
        self.asked = asked  # names that code reads, which others do not need
        self.noticed = set(asked)
        self.folder = ""  # of the code being examined
        self.sets: tuple[int, ...] = ()  # whose members are being examined
        self.members: dict[tuple[Any, ...], tuple[bytes, Any]] = {}  # of sets, as encoded
        self.seen: dict[int, int] = {}
        self.kept: list[Any] = []  # so that no other object gets the same id

    def put(self, kind: str, *texts: str | bytes) -> None:
        """Add texts."""
        for text in (kind, *texts):
            raw = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
            self.digest.update(struct.pack("<Q", len(raw)) + raw)

    @contextmanager
    def at(self, crumb: str) -> Iterator[None]:
        """Current place, for messages."""
        self.path.append(crumb)
        yield
        self.path.pop()  # kept if something is refused

    def values(self, kind: str, values: Iterable[Any]) -> None:
        """Add values in their order."""
        listed = list(values)
        self.put(kind, str(len(listed)))
        for i, value in enumerate(listed):
            with self.at(f"[{i}]"):
                self.value(value)

    def named(self, kind: str, values: Mapping[str, Any]) -> None:
        """Add values under their names."""
        self.put(kind, str(len(values)))
        if "order" in self.asked:
            self.put("order", *values)
        for name in sorted(values):
            self.put("name", name)
            with self.at(name):
                self.value(values[name])

    def apart(self, value: Any, inside: int = 0) -> bytes:
        """A hash of a single value, for unordered collections."""
        if isinstance(value, str) and type(value) is str:
            return b"str" + self._local(value).encode("utf-8", "surrogatepass")
        other = type(self)(self.path, self.asked)
        other.folder, other.sets = self.folder, (*self.sets, inside) if inside else self.sets
        other.members, other.noticed = self.members, self.noticed
        key = (id(value), other.folder, other.sets)
        if key not in self.members:
            other.value(value)
            self.members[key] = other.digest.digest(), value
        return self.members[key][0]

    def _local(self, text: str) -> str:
        """A text without the folder of the code, if it is a path in that folder."""
        if self.folder and text.startswith(self.folder):
            rest = text[len(self.folder) :]
            if not rest or rest.startswith(os.sep):
                return f"\0folder{rest}"
        return text

    @abstractmethod
    def value(self, x: Any) -> None:
        """Add any value."""

    def set(self, x: Any) -> None:
        """Add a set, independent of its order."""
        if id(x) in self.sets:
            self.put("set above", str(len(self.sets) - self.sets.index(id(x))))
            return
        self.put("set", str(len(x)))
        if type(x) not in (set, frozenset):
            self.value(type(x))
            self.value(taking_apart.held(x))
        for part in sorted(self.apart(item, id(x)) for item in x):
            self.put("item", part)

    def dict(self, x: Mapping[Any, Any], in_order: bool = True) -> None:
        """Add a dict by its keys, including their order if it differs from the canonical one."""
        self.put("dict", str(len(x)))
        items = sorted(((self.apart(key), key) for key in x), key=lambda item: item[0])
        places = {id(key): place for place, key in enumerate(x)}
        order = [places[id(key)] for _, key in items]
        if in_order and order != [*range(len(order))]:
            self.put("order", str(order))
        for part, key in items:
            self.put("key", part)
            with self.at(_shown(key)):
                self.value(x[key])

    def array(self, x: np.ndarray[Any, Any]) -> None:
        """Add an array: type, shape, and values in C order."""
        self.put("array", x.dtype.str, str(x.shape))
        if type(x) is not np.ndarray:
            self.value(type(x))
            self.value(taking_apart.held(x))
            if isinstance(x, np.ma.MaskedArray):
                self.value(np.ma.getmaskarray(x))
        plain = np.asarray(x)
        if plain.dtype.names:  # the gaps between fields may hold anything
            self.named("fields", {name: plain[name] for name in plain.dtype.names})
        elif plain.dtype.hasobject:
            self.values("items", plain.ravel().tolist())
        else:
            self.put("data", taking_apart.content(plain))


def exactly(x: float) -> str:
    """A float with all its bits; the usual NaN is written as such."""
    raw = struct.pack("<d", x)
    return x.hex() if x == x or raw == struct.pack("<d", float("nan")) else raw.hex()


def _shown(key: object) -> str:
    return f"[{shortened(key if isinstance(key, str) else repr(key), 40)}]"
