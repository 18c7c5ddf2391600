"""What a shared library of any platform exports and needs, read from the file itself."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from struct import unpack_from


@dataclass
class Binary:
    """What is in a shared library.

    Attributes
    ----------
    exports
        Names that others can look up, without the underscore that macOS puts before them.
    needs
        Libraries that are loaded with it.
    versions
        Versions of symbols it asks of them, e.g. ``GLIBC_2.17``.
    """

    machine: str
    exports: set[str] = field(default_factory=set)
    needs: set[str] = field(default_factory=set)
    versions: set[str] = field(default_factory=set)


def read(data: bytes) -> Binary:
    if data[:4] == b"\x7fELF":
        return _elf(data)
    if data[:2] == b"MZ":
        return _pe(data)
    assert unpack_from("<I", data)[0] == 0xFEEDFACF
    return _mach_o(data)


def text(data: bytes, start: int) -> str:
    return data[start : data.index(b"\0", start)].decode()


def _elf(data: bytes) -> Binary:
    machine = {62: "x86_64", 183: "aarch64"}[unpack_from("<H", data, 18)[0]]
    found = Binary(f"{machine}-linux")
    (table,), (size, count) = unpack_from("<Q", data, 40), unpack_from("<HH", data, 58)
    sections = [unpack_from("<IIQQQQIIQQ", data, table + i * size) for i in range(count)]
    for _, kind, _, _, start, length, link, _, _, entry in sections:
        strings = sections[link][4] if link < count else 0
        if kind == 11:  # dynamic symbols
            for place in range(start, start + length, entry):
                name, _, _, section = unpack_from("<IBBH", data, place)
                if name and section:
                    found.exports.add(text(data, strings + name))
        elif kind == 6:  # dynamic section
            for place in range(start, start + length, entry):
                tag, value = unpack_from("<QQ", data, place)
                if tag == 1:
                    found.needs.add(text(data, strings + value))
        elif kind == 0x6FFFFFFE:  # versions needed
            (end,) = (s[4] + s[5] for s in sections if s[4] == strings)
            names = re.findall(rb"\0(GLIBC_[\d.]+)\0", data[strings:end].replace(b"\0", b"\0\0"))
            found.versions |= {name.decode() for name in names}
    return found


def _pe(data: bytes) -> Binary:
    (start,) = unpack_from("<I", data, 0x3C)
    machine, count, optional = unpack_from("<HH12xH", data, start + 4)
    found = Binary({0x8664: "x86_64-windows"}[machine])
    header = start + 24
    assert unpack_from("<H", data, header)[0] == 0x20B
    sections = [unpack_from("<IIII", data, header + optional + 40 * i + 8) for i in range(count)]

    def offset(address: int) -> int:
        return next(
            address - virtual + raw
            for size, virtual, raw_size, raw in sections
            if virtual <= address < virtual + max(size, raw_size)
        )

    exports, imports = unpack_from("<I4xI", data, header + 112)
    number, _, names = unpack_from("<III", data, offset(exports) + 24)
    for i in range(number):
        (name,) = unpack_from("<I", data, offset(names) + 4 * i)
        found.exports.add(text(data, offset(name)))
    place = offset(imports)
    while (name := unpack_from("<I", data, place + 12)[0]) != 0:
        found.needs.add(text(data, offset(name)).lower())
        place += 20
    return found


def _mach_o(data: bytes) -> Binary:
    kind, count = unpack_from("<4xI8xI", data)
    machine = {0x01000007: "x86_64", 0x0100000C: "aarch64"}[kind]
    found = Binary(f"{machine}-darwin")
    place = 32
    for _ in range(count):
        command, size = unpack_from("<II", data, place)
        if command == 0xC:  # LC_LOAD_DYLIB
            found.needs.add(text(data, place + unpack_from("<I", data, place + 8)[0]))
        elif command in (0x80000022, 0x80000033):  # LC_DYLD_INFO_ONLY, LC_DYLD_EXPORTS_TRIE
            start, length = unpack_from("<II", data, place + (40 if command == 0x80000022 else 8))
            found.exports = {name[1:] for name in _trie(data[start : start + length], 0, "")}
        place += size
    return found


def _trie(data: bytes, place: int, name: str) -> set[str]:
    size, place = _uleb128(data, place)
    found = {name} if size else set()
    place += size
    children = data[place]
    place += 1
    for _ in range(children):
        edge = text(data, place)
        child, place = _uleb128(data, place + len(edge) + 1)
        found |= _trie(data, child, name + edge)
    return found


def _uleb128(data: bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return value, place
