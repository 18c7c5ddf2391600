"""Broken FMUs, from a seed: ``python broken_fmus.py SEED COUNT`` reads COUNT of them.

A case is named by its seed alone. It ends with `FmuError` or with an FMU that was read, within
20 s; the process as a whole needs less than 1 GB.
"""

from __future__ import annotations

import io
import random
import re
import resource
import signal
import struct
import sys
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from sblcosim.fmus.conformance.facts import subject_of
from sblcosim.fmus.conformance.receiver_contract import check_receiver
from sblcosim.fmus.errors import FmuError
from sblcosim.fmus.platforms import folder, suffix, this_platform
from sblcosim.fmus.read.archive import opened
from sblcosim.fmus.read.description import describe, library_of
from sblcosim.fmus.read.ports import read
from sblcosim.fmus.terminals import TERMINALS

HERE = Path(__file__).parents[2] / "fmu" / "planted"
SECONDS, MEGABYTES = 20, 1000
"""Of a processor."""
PATIENCE = 600
"""Seconds, for what waits for ever."""

NASTY = (
    "", " ", "0", "-1", "1e999", "nan", "INF", "4294967296", "99999999999", "9" * 5000,
    "x" * 10_000, "1.5", "0x10", "true", "\u0660", "a b", "../../etc/passwd", "/dev/zero", "CON",
    "a\\b",
    "position[99999999999]", "position[0]", "position[-1]", "position[999999999]", "position[1",
    "[1]", "x[1][2]", "x" + "[1" * 500, "&#10;", "&#0;", "&undefined;", "%s%n", "2.0", "3.0", "3.",
    "input", "output", "structuralParameter", "independent", "constant", "1 " * 1000, "time",
)  # fmt: skip
XML_PIECES = (
    '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
    '<!DOCTYPE a SYSTEM "file:///dev/zero">', "<Dimension start='99999999999'/>",
    "<Dimension valueReference='2'/>", "<Dimension start='1000000'/>" * 3, "<a>" * 500,
    "<a/>" * 5000, "<?xml version='1.0'?>", "<!-- -->", "<![CDATA[x]]>", "\0", "\ufeff", "&lt;",
    "<Start value='1'/>", "<Alias name='b' displayUnit='c'/>", "<Unit name='m'/>",
    "<CoSimulation/>",
    "<ScheduledExecution modelIdentifier='planted'/>", "<Unknown index='99' dependencies='99'/>",
)  # fmt: skip
FIELDS = (0, 1, 8, 12, 14, 0x41, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)
NAMES = (
    "../evil", "/evil", "a/../../evil", "C:evil", "a\\b", "modelDescription.xml/x", "x" * 300,
    "nul\0l", "modelDescription.xml", "binaries", "binaries/linux64", "", ".", "a//b", "\udcff",
)  # fmt: skip


def intact(fmi: int) -> dict[str, bytes]:
    """The files of an FMU, with terminals and a library that nobody loads."""
    place = folder(this_platform(), 2 if fmi == 2 else 3)
    return {
        "modelDescription.xml": (HERE / f"fmi{fmi}.xml").read_bytes(),
        f"binaries/{place}/planted{suffix(place)}": bytes(range(256)) * 20,
        TERMINALS: b'<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals><Terminal name="out" '
        b'matchingRule="plug" terminalKind="org.sblcosim.estimate"><TerminalMemberVariable '
        b'variableName="epoch" memberName="epoch" variableKind="signal"/></Terminal></Terminals>'
        b"</fmiTerminalsAndIcons>",
        "resources/data.txt": b"0123456789" * 100,
    }


def packed(files: dict[str, bytes]) -> bytes:
    """An archive."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return content.getvalue()


def in_attribute(g: random.Random, xml: str) -> str:
    """Another value of an attribute."""
    places = list(re.finditer(r'="([^"]*)"', xml))
    start, end = g.choice(places).span(1)
    return xml[:start] + g.choice(NASTY) + xml[end:]


def of_attribute(g: random.Random, xml: str) -> str:
    """An attribute less, twice, or more."""
    place = g.choice(list(re.finditer(r' [\w:]+="[^"]*"', xml)))
    more = g.choice(
        ("", place[0] * 2, f'{place[0]} start="{g.choice(NASTY)}" min="{g.choice(NASTY)}"')
    )
    return xml[: place.start()] + more + xml[place.end() :]


def of_element(g: random.Random, xml: str) -> str:
    """A tag less, twice, elsewhere, or something put in."""
    place = g.choice(list(re.finditer(r"<[^>]*>", xml)))
    piece = g.choice(("", place[0] * 2, place[0] + g.choice(XML_PIECES)))
    return xml[: place.start()] + piece + xml[place.end() :]


def of_encoding(g: random.Random, xml: str) -> str:
    """Another encoding or version of XML."""
    encoding = g.choice(
        ("nonsense", "utf-7", "utf-16", "ascii", "idna", "zlib", "euc-jp", "", "x" * 999)
    )
    return xml.replace('encoding="UTF-8"', f'encoding="{encoding}"')


XML_CHANGES: tuple[Callable[[random.Random, str], str], ...] = (
    in_attribute, in_attribute, of_attribute, of_element, of_encoding,
)  # fmt: skip


def of_bytes(g: random.Random, data: bytes) -> bytes:
    """Bytes flipped, cut off, put in or taken out."""
    changed = bytearray(data)
    for _ in range(g.choice((1, 1, 2, 5, 50))):
        place = g.randrange(len(changed))
        kind = g.randrange(5)
        if kind <= 1:
            changed[place] ^= 1 << g.randrange(8)
        elif kind == 2:
            changed[place:] = b"" if g.random() < 0.3 else changed[place:]
        elif kind == 3:
            changed[place:place] = g.randbytes(g.choice((1, 4, 1000)))
        else:
            del changed[place : place + g.choice((1, 4, 100))]
        if not changed:
            return b""
    return bytes(changed)


def of_header(g: random.Random, data: bytes) -> bytes:
    """Another number in a header of the archive."""
    changed = bytearray(data)
    for _ in range(g.choice((1, 1, 3))):
        headers = [m.start() for m in re.finditer(rb"PK(\x01\x02|\x03\x04|\x05\x06)", data)]
        place = g.choice(headers) + 4 + 2 * g.randrange(20)
        form, size = g.choice((("<H", 2), ("<I", 4)))
        if place + size <= len(changed):
            limit = 2 ** (8 * size) - 1
            changed[place : place + size] = struct.pack(form, g.choice(FIELDS) & limit)
    return bytes(changed)


def of_names(g: random.Random, files: dict[str, bytes]) -> bytes:
    """An archive with an odd file more, or a link."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", g.choice((0, 8, 12, 14))) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
        entry = zipfile.ZipInfo("placeholder")
        entry.filename = g.choice(NAMES)
        entry.external_attr = g.choice((0, 0o100644, 0o120777, 0o010644, 0o060644, 0o040755)) << 16
        with suppress(UnicodeError, struct.error):
            archive.writestr(entry, g.choice((b"", b"/etc/passwd", b"\0" * 100_000)))
    return content.getvalue()


def broken(seed: int) -> bytes:
    """The content of an FMU file."""
    g = random.Random(seed)
    files = intact(g.choice((2, 3)))
    kind = g.randrange(10)
    if kind <= 5:
        name = g.choice(("modelDescription.xml",) * 6 + (TERMINALS,))
        xml = files[name].decode()
        for _ in range(g.choice((1, 1, 1, 2, 4))):
            xml = g.choice(XML_CHANGES)(g, xml)
        files[name] = xml.encode(errors="surrogatepass")
        if g.random() < 0.1:
            files[name] = of_bytes(g, files[name])
        return packed(files)
    if kind == 6:
        return of_names(g, files)
    return of_header(g, packed(files)) if kind <= 8 else of_bytes(g, packed(files))


def use(path: Path) -> None:
    """Everything that is done with an FMU before any of it is run."""
    read(path)
    str(check_receiver(path))
    with opened(path) as archive, tempfile.TemporaryDirectory() as place:
        description = describe(archive)
        archive.unpack(Path(place) / "fmu")
        subject_of(description, Path(place) / "fmu", library_of(archive, description))


def _peak() -> int:
    """The most memory that this process has had [MB]; what began it counts for getrusage, too."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(status.read_text().partition("VmHWM:")[2].split()[0]) // 2**10
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most // (2**20 if sys.platform == "darwin" else 2**10)


def main(first: int, count: int) -> None:
    """Read many; the first one that does not end as it should ends this."""
    refused = 0
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "broken.fmu"
        for seed in range(first, first + count):
            path.write_bytes(broken(seed))
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            signal.alarm(PATIENCE)
            said = f"{path}: was read"
            try:
                use(path)
            except FmuError as error:
                refused += 1
                said = str(error)
            except BaseException:
                print(f"seed {seed}", file=sys.stderr)
                raise
            finally:
                signal.alarm(0)
                signal.setitimer(signal.ITIMER_PROF, 0)
            assert said.isprintable(), (seed, said)
            assert said.startswith(f"{path}: "), (seed, said)
            assert len(said) < 500, (seed, said)
            assert [p.name for p in Path(place).iterdir()] == [path.name], seed
    most = _peak()
    assert most < MEGABYTES, f"{most} MB"
    print(f"{refused} of {count} refused, {most} MB")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
