"""Logs of FMUs as lines for people: the same for every host, with only the standard library.

In FMI 2 a message is a format of C's ``printf``, followed by its values. It names variables by
their references, as in ``#r12# must be below %g`` (FMI 2.0.5, 2.1.5). ctypes does not pass on
values after the message, so this logger is declared with all registers and stack slots where a C
compiler may have put them. FMUs from other tools often log formats that do not fit their values
(``100% sure``): what cannot be formatted stays as written, and addresses that cannot be read are
not followed.
"""

from __future__ import annotations

import ctypes
import math
import os
import re
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from ..errors import escaped
from ..platforms import this_platform
from .signatures import LOGGERS, WARNING

Take = Callable[[int | None, bytes, int, bytes], None]
"""Receives the environment, the instance's name, the status and the formatted message."""
NameOf = Callable[[str, int], str | None]
"""The variable of an FMI 2 type, such as ``Real``, with a value reference."""

LONGEST = 500
"""Number of characters kept of a message."""
_MOST = 4096
"""Number of bytes read from a message and from a text in it."""
_WIDEST = 200
"""Maximum width of a number."""
_STACK = 24
"""Number of stack slots that are examined."""


class _Registers(NamedTuple):
    """Registers after the five fixed arguments of a logger.

    Attributes
    ----------
    unused
        Number of registers without values, because these are all on the stack.
    whole, real
        Number of registers with the first whole numbers and addresses, and with the first real
        numbers.
    """

    unused: int
    whole: int
    real: int


_REGISTERS = {
    "x86_64-linux": _Registers(0, 1, 8),
    "x86_64-darwin": _Registers(0, 1, 8),
    "x86_64-windows": _Registers(0, 0, 0),
    "aarch64-linux": _Registers(0, 3, 8),
    "aarch64-darwin": _Registers(3, 0, 0),
}
"""Where a variadic function finds its arguments, by the calling conventions of the platforms."""

_CONVERSION = re.compile(
    rb"%(?P<flags>[-+ #0']*)(?P<width>\*|\d{0,9})(?:\.(?P<precision>\*|-?\d{0,9}))?"
    rb"(?P<length>hh|h|ll|l|q|j|z|t|I64|I32|I)?(?P<kind>[diouxXeEfFgGaAcspn%])"
)
_REFERENCE = re.compile(r"##|#([ribs])(\d{1,10})#")
_TYPES = {"r": "Real", "i": "Integer", "b": "Boolean", "s": "String"}
_LONG = 8 * ctypes.sizeof(ctypes.c_long)
_BITS = {b"hh": 8, b"h": 16, b"": 32, b"I32": 32, b"l": _LONG}
"""Bits of whole numbers by the length in the format; 64 for all other lengths."""


class Values:
    """The values that follow a message, each read once.

    Raises
    ------
    IndexError
        There are no more slots to read.
    """

    def __init__(self, whole: list[int], real: list[float], stack: list[int]) -> None:
        self._whole, self._real, self._stack = iter(whole), iter(real), iter(stack)

    def whole(self) -> int:
        """The next whole number or address, 64 bits unsigned."""
        value = next(self._whole, None)
        return self._next() if value is None else value

    def real(self) -> float:
        """The next real number."""
        value = next(self._real, None)
        if value is None:
            (value,) = struct.unpack("<d", struct.pack("<Q", self._next()))
        return value

    def _next(self) -> int:
        value = next(self._stack, None)
        if value is None:
            raise IndexError
        return value


def logger2(take: Take) -> Any:
    """A logger of FMI 2, to be kept as long as an FMU may call it; it reports only problems."""
    registers = _REGISTERS.get(this_platform())
    unused, whole, real = registers or (0, 0, 0)
    stack = _STACK if registers else 0
    first = unused + whole

    def log(
        environment: int | None, name: int | None, status: int, category: int | None,
        message: int | None, *places: Any,
    ) -> None:  # fmt: skip
        if status < WARNING:
            return
        values = [*places[unused:first]], [*places[first : first + real]], [*places[first + real :]]
        text = formatted(text_at(message), Values(*values) if registers else None)
        take(environment, text_at(name), status, text)

    places = [ctypes.c_uint64] * first + [ctypes.c_double] * real + [ctypes.c_uint64] * stack
    return ctypes.CFUNCTYPE(None, *map(_unread, LOGGERS[2]), *places)(log)


def logger3(take: Take) -> Any:
    """The same for FMI 3, where a message is plain text."""

    def log(
        environment: int | None, status: int, category: int | None, message: int | None
    ) -> None:
        if status >= WARNING:
            take(environment, b"", status, text_at(message))

    return ctypes.CFUNCTYPE(None, *map(_unread, LOGGERS[3]))(log)


def _unread(kind: Any) -> Any:
    """Type of an argument; for texts their address, because we read them ourselves."""
    return ctypes.c_void_p if kind is ctypes.c_char_p else kind


def line(message: bytes, name_of: NameOf | None = None, most: int = LONGEST) -> str:
    """A message on one line with only printable characters.

    Parameters
    ----------
    name_of
        For FMI 2, where messages name variables by their references.
    most
        Number of characters to keep.
    """
    text = message.decode(errors="replace")
    if name_of is not None:
        text = _REFERENCE.sub(lambda match: _named(match, name_of), text)
    text = escaped(" ".join(text.split()))
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _named(match: re.Match[str], name_of: NameOf) -> str:
    if match[0] == "##":
        return "#"
    return name_of(_TYPES[match[1]], int(match[2])) or match[0]


def text_at(address: int | None, most: int = _MOST) -> bytes:
    """A C text, or its first bytes; empty for addresses that cannot be read."""
    return _read(address, most) or b""


def _read(address: int | None, most: int) -> bytes | None:
    if not address:
        return None
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY)
    except OSError:  # not Linux: a wrong address crashes us
        return ctypes.string_at(address)[:most]
    text = b""
    try:
        while len(text) < most:
            at = address + len(text)
            piece = os.pread(memory, min(most - len(text), 4096 - at % 4096), at)
            before, end, _ = piece.partition(b"\0")
            text += before
            if end or not piece:
                break
    except (OSError, OverflowError):  # whatever was read so far is no text either
        return None
    finally:
        os.close(memory)
    return text


def formatted(message: bytes, values: Values | None) -> bytes:
    """A message with its values.

    Parameters
    ----------
    values
        None: the values are unknown; their formats stay as written.
    """
    text, end = b"", 0
    for match in _CONVERSION.finditer(message):
        text += message[end : match.start()]
        end = match.end()
        if match["kind"] == b"%" and match[0] != b"%%":
            written: bytes | None = None
        elif match["kind"] == b"%":
            written = b"%"
        elif values is None or _is_prose(match, message[end : end + 1]):
            written = None
        else:
            try:
                written = _converted(match, values)
            except IndexError:
                values = written = None
        text += match[0] if written is None else written
        if len(text) > _MOST:
            return text
    return text + message[end:]


def _is_prose(match: re.Match[bytes], following: bytes) -> bool:
    """Whether it is a per cent sign before a word, not a conversion: ``100% sure``, ``5% of``."""
    if match["kind"] in (b"c", b"s", b"p", b"n"):
        return re.search(rb"[ +#']", match["flags"]) is not None
    alone = match["flags"] == b" " and not match["width"] and match["precision"] is None
    return alone and following.isalpha()


def _converted(match: re.Match[bytes], values: Values) -> bytes | None:
    """A value formatted by the conversion; None if that is impossible."""
    kind, length = match["kind"].decode(), match["length"] or b""
    flags = match["flags"].replace(b"'", b"").decode()
    width = _size(match["width"] or b"0", values)
    precision = -1 if match["precision"] is None else _size(match["precision"] or b"0", values)
    if width < 0:
        flags, width = f"{flags}-", -width
    asked = f"%{flags}{min(width, _WIDEST) or ''}"
    if kind in "eEfFgGaA":
        real = values.real()
        if not math.isfinite(real):
            asked = asked.replace("0", "", flags.count("0"))
        return _number(asked, kind, precision, real)
    value = values.whole()
    if kind == "n":
        return b""  # C would write to the address
    if kind in "cs":
        wide = length not in (b"", b"h")
        text = None if wide else _text(kind, value, precision)
        return None if text is None else f"{asked}s".encode() % text
    if kind == "p":
        return f"{asked}s".encode() % f"{value:#x}".encode()
    bits = _BITS.get(length, 64)
    value &= (1 << bits) - 1
    if kind in "di" and value >> (bits - 1):
        value -= 1 << bits
    return _number(asked, kind, precision, value)


def _size(text: bytes, values: Values) -> int:
    """A width or precision, which may be one of the values."""
    return ctypes.c_int32(values.whole()).value if text == b"*" else int(text)


def _text(kind: str, value: int, precision: int) -> bytes | None:
    """A character or a text; None if it cannot be read."""
    if kind == "c":
        return bytes([value & 0xFF])
    return _read(value, min(precision, _MOST) if precision >= 0 else _MOST) if value else b"(null)"


def _number(asked: str, kind: str, precision: int, value: float) -> bytes:
    if kind in "aA":
        text = value.hex() if isinstance(value, float) else ""
        return (f"{asked}s" % (text.upper() if kind == "A" else text)).encode()
    if kind in "uoxX":  # unsigned; 0 has no prefix
        asked = re.sub(r"[+ ]" if value else r"[+ #]", "", asked)
    if precision >= 0:
        asked += f".{min(precision, _WIDEST)}"
    text = f"{asked}{kind}" % value
    return (text.replace("0o", "0", 1) if kind == "o" else text).encode()
