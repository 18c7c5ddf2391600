"""What FMUs log comes out as C's printf would write it, and never crashes whoever listens."""

from __future__ import annotations

import ctypes
import random
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from sblcosim.fmus.host.log_lines import LONGEST, Values, formatted, line, logger2, logger3

CASES = 150
WHOLE = {
    "": "int", "hh": "int", "h": "int", "l": "long", "ll": "long long", "z": "size_t",
    "j": "intmax_t", "t": "ptrdiff_t",
}  # fmt: skip
TEXTS = ("", "a", "per cent", "#r1#", "x" * 30, "\\xc3\\xbc", "a\\tb")
REALS = ("0.0", "-1.5", "3.14159265", "1e300", "-2.5e-7", "123456.0", "INFINITY")
NEEDS_CC = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")


def conversion(g: random.Random) -> tuple[str, list[str]]:
    """One, with the C expressions of its values."""
    kind = g.choice("dduxXcssffeegGi")
    flags = "".join(f for f in "-+ 0" if g.random() < 0.2) if kind not in "cs" else ""
    flags = flags.replace("0", "") if "-" in flags or kind in "duxXi" else flags
    flags = flags.replace(" ", "") if "+" in flags else flags
    values, width, precision = [], "", ""
    if g.random() < 0.4:
        width = g.choice(("3", "12", "*"))
        values += [str(g.randint(-9, 15))] if width == "*" else []
    if kind not in "cdiuxX" and g.random() < 0.5:
        precision = g.choice((".0", ".", ".3", ".*"))
        values += [str(g.randint(-2, 9))] if precision == ".*" else []
    length = g.choice(list(WHOLE)) if kind in "diuxX" else ""
    if kind in "diuxX":
        value = f"({WHOLE[length]})({g.choice(('-1', '0', '7', '-300', '70000', '2147483647'))})"
    elif kind == "c":
        value = "'z'"
    elif kind == "s":
        value = f'"{g.choice(TEXTS)}"'
    else:
        value = g.choice(REALS)
    return f"%{flags}{width}{precision}{length}{kind}", [*values, value]


def case(seed: int) -> tuple[str, str]:
    """A format and its values, as they stand in a call."""
    g = random.Random(seed)
    text, values = "", []
    for _ in range(g.choice((0, 1, 2, 5, 9, 14))):
        written, given = conversion(g)
        text += g.choice(("", " ", "%% ", " x = ", "\\n")) + written
        values += given
        if len(values) > 20:
            break
    return text + g.choice(("", ".", " 5%%")), "".join(f", {value}" for value in values)


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """A library that logs any of the cases, and writes what C makes of it."""
    folder = tmp_path_factory.mktemp("driver")
    calls = "".join(
        f'case {i}: if (log) log(env, "name", 3, "c", "{text}"{values});'
        f' else snprintf(to, 4000, "{text}"{values}); break;\n'
        for i, (text, values) in enumerate(map(case, range(CASES)))
    )
    (folder / "driver.c").write_text(
        "#include <math.h>\n#include <stddef.h>\n#include <stdint.h>\n#include <stdio.h>\n"
        "typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);\n"
        "void go(logger log, void *env, char *to, int i) { switch (i) {\n" + calls + "} }\n"
        "void say(logger log, int status, const char *message)\n"
        '{ log((void *)7, "name", status, "c", message); }\n'
        "void say3(void (*log)(void *, int, const char *, const char *), const char *message)\n"
        '{ log((void *)7, 3, "c", message); }\n'
    )
    library = folder / "driver.so"
    command = ["cc", "-shared", "-fPIC", "-O1", "-w", "-o", library, folder / "driver.c"]
    subprocess.run(command, check=True)
    result = ctypes.CDLL(str(library))
    pointer, number = ctypes.c_void_p, ctypes.c_int
    result.go.argtypes = pointer, pointer, ctypes.c_char_p, number
    result.say.argtypes = pointer, number, pointer
    result.say3.argtypes = pointer, pointer
    return result


def heard(call: Callable[[ctypes.c_void_p], object], make: Callable[..., object] = logger2
          ) -> list[tuple[int | None, bytes, int, bytes]]:
    """What a logger has taken while something is called with it."""
    taken: list[tuple[int | None, bytes, int, bytes]] = []
    logger = make(lambda *what: taken.append(what))
    call(ctypes.cast(logger, ctypes.c_void_p))  # type: ignore[arg-type]
    return taken


@NEEDS_CC
def test_messages_are_those_of_printf(driver: ctypes.CDLL) -> None:
    for i in range(CASES):
        expected = ctypes.create_string_buffer(4000)
        driver.go(None, None, expected, i)
        got = heard(lambda logger, i=i: driver.go(logger, 7, None, i))
        assert got == [(7, b"name", 3, expected.value)], case(i)


@NEEDS_CC
@pytest.mark.parametrize("message", [
    b"100% sure", b"100% done", b"5% of it", b"%", b"%%", b"50 %", b"%s", b"%s %s %s %s %s %s",
    b"%n", b"%n%n%n%n%n%n%n%n", b"%d" * 200, b"%f" * 200, b"%s" * 2000, b"%99999999999999d",
    b"%2000000000d", b"%.2000000000f", b"%*.*f", b"%ls", b"%hs", b"%q", b"%lc", b"%Lf", b"%1$s",
    b"%-+ #0d", b"\xff\xfe\x00", b"%" * 5000, b"x" * 100_000, b"#r1", b"#r99999999999999999#",
    b"##", b"%$%k%y%", b"%s\x1b[31m%p",
])  # fmt: skip
def test_no_message_crashes_whoever_listens(driver: ctypes.CDLL, message: bytes) -> None:
    """Without any value, whatever lies where they would be."""
    text = ctypes.create_string_buffer(message)
    for status in (3, 3, 1):
        ((_, _, _, got),) = heard(lambda log, s=status: driver.say(log, s, ctypes.addressof(text)))
        shown = line(got, lambda kind, reference: "x")
        assert shown.isprintable()
        assert len(shown) <= LONGEST


@NEEDS_CC
def test_addresses_that_cannot_be_read_are_not_followed(driver: ctypes.CDLL) -> None:
    if not Path("/proc/self/mem").exists():
        pytest.skip("only Linux can tell")
    for address in (1, 0xDEADBEEF000, 2**63, 2**64 - 1):
        assert heard(lambda log, a=address: driver.say(log, 3, a))[0][3] == b""
        assert formatted(b"%s %d", Values([address, 5], [], [])) == b"%s 5"


@NEEDS_CC
def test_only_trouble_is_taken(driver: ctypes.CDLL) -> None:
    text = ctypes.create_string_buffer(b"all well")
    assert heard(lambda log: driver.say(log, 0, ctypes.addressof(text))) == []


@NEEDS_CC
def test_messages_of_fmi_3_are_no_formats(driver: ctypes.CDLL) -> None:
    text = ctypes.create_string_buffer(b"100%s ##1 #r1# %d")
    ((_, _, _, got),) = heard(lambda log: driver.say3(log, ctypes.addressof(text)), logger3)
    assert line(got) == "100%s ##1 #r1# %d"


def test_values_that_are_not_known_stay_as_they_are_written() -> None:
    assert formatted(b"%d of %5.2f, 100 %% %s", None) == b"%d of %5.2f, 100 % %s"


def test_prose_is_no_conversion_and_leaves_the_values_to_others() -> None:
    values = Values([1, 2], [], [])
    assert formatted(b"100% sure, 5% of %d, % d", values) == b"100% sure, 5% of 1,  2"
    values = Values([1, 2], [], [])
    assert formatted(b"% .3done, % 3done, 5% done", values) == b" 001one,   2one, 5% done"


@pytest.mark.parametrize(("message", "expected"), [
    ("#r1365# must be larger than zero (used in IO channel ##4)",
     "body.m must be larger than zero (used in IO channel #4)"),
    ("#i1365#, #b2#, #s3#", "gears, on, name"),
    ("##r1365# ###r1365# #r1365##", "#r1365# #body.m body.m#"),
    ("#r7# is unknown, #x1# and #r# are none", "#r7# is unknown, #x1# and #r# are none"),
])  # fmt: skip
def test_references_are_the_names_of_variables(message: str, expected: str) -> None:
    """The first is the example of FMI 2.0.5, 2.1.5."""
    names = {("Real", 1365): "body.m", ("Integer", 1365): "gears", ("Boolean", 2): "on",
             ("String", 3): "name"}  # fmt: skip
    assert line(message.encode(), lambda *what: names.get(what)) == expected
    assert line(message.encode()) == message


def test_lines_are_short_and_print() -> None:
    assert line(b" a\n\tb\r\n ") == "a b"
    assert line(b"\x1b[31m\x07") == "\\x1b[31m\\x07"
    assert line(b"Lizenz ung\xfcltig") == "Lizenz ung\N{REPLACEMENT CHARACTER}ltig"
    assert line("ü".encode() * 4000) == "ü" * (LONGEST - 1) + "…"
    assert line(b"x" * 50, most=10) == "x" * 9 + "…"
