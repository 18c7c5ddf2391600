"""Mutated logs end in a checked log that accounts for every entry, or in one line."""

from __future__ import annotations

import csv
import os
import random
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import mutators
import pytest
from log_samples import SAMPLES
from sblcosim import read_log
from sblcosim.errors import ConfigurationError
from sblcosim.logs.contents import contents_of
from sblcosim.logs.log import Log

TABLES = ("own", "long", "wide", "excerpt")
"""Samples whose files are tables with a known number of lines."""
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?")


def _renamed(random_: random.Random, content: bytes) -> bytes:
    """A column with another name."""
    head, _, rest = content.partition(b"\n")
    names = re.split(rb"([,;])", head)
    i = random_.randrange(0, len(names), 2)
    names[i] = random_.choice([names[i] + b"x", names[i].upper(), b"", names[0], names[i][::-1],
                               b"range_km", b"time", b"line", b"beacon", b"valid"])
    return b"".join(names) + b"\n" + rest


def _number(random_: random.Random, content: bytes) -> bytes:
    """Other numbers in some places."""
    places = list(_NUMBER.finditer(content))
    for found in sorted(random_.sample(places, min(len(places), random_.choice([1, 1, 5]))),
                        key=lambda it: -it.start()):
        new = random_.choice(mutators.NUMBERS).encode()
        content = content[: found.start()] + new + content[found.end() :]
    return content


def _lines(random_: random.Random, content: bytes) -> bytes:
    """Lines that are cut, twice, elsewhere, or full of something else."""
    lines = content.split(b"\n")
    for _ in range(random_.choice([1, 4, 12])):
        i, j = random_.randrange(len(lines)), random_.randrange(len(lines))
        match random_.randrange(6):
            case 0:
                lines[i] = lines[i][: random_.randrange(len(lines[i]) + 1)]
            case 1:
                lines.insert(i, lines[j])
            case 2:
                lines[i], lines[j] = lines[j], lines[i]
            case 3:
                lines[i] += random_.choice([b",", b";", b'"', b"\0", b"\xff", b"}", b"*0", b"\x0c"])
            case 4:
                lines[i] = random_.choice(mutators.WORDS).encode(errors="surrogatepass")
            case 5:
                lines[i] = lines[i].replace(b"B1", b"B9").replace(b",1,", b",,")
    return b"\n".join(lines)


def _encoded(random_: random.Random, content: bytes) -> bytes:
    """Another encoding, another end of lines."""
    text = content.decode()
    return random_.choice([
        lambda: text.encode("utf-16"), lambda: b"\xef\xbb\xbf" + content,
        lambda: text.replace("\n", "\r\n").encode(), lambda: text.replace("\n", "\r").encode(),
        lambda: text.encode("utf-16-le"), lambda: text.replace(",", ";").encode(),
        lambda: text.replace(".", ",").encode(), lambda: b"", lambda: b"\n\n", lambda: b"\0" * 50,
        lambda: text.replace("e", "é").encode("latin-1"), lambda: content.rstrip(b"\n"),
        lambda: b"\xef\xbb\xbf" * 2 + content,
    ])()  # fmt: skip


def _toml(random_: random.Random, content: bytes) -> bytes:
    return mutators.toml(random_, content.decode()).encode(errors="surrogatepass")


KINDS: list[Callable[[random.Random, bytes], bytes]] = [
    mutators.damaged, _renamed, _number, _lines, _encoded,
]


def _other_thing(random_: random.Random, file: Path) -> None:
    """Something else in place of a file."""
    file.unlink()
    match random_.randrange(4):
        case 0:
            file.mkdir()
        case 1:
            os.mkfifo(file)
        case 2:
            file.symlink_to(random_.choice([file.name, "/dev/zero", "/dev/null", "nothing"]))


@pytest.mark.skipif(os.name == "nt", reason="there are no pipes")
@mutators.cases(quick=30, most=1500)
def test_a_mutated_log_is_accounted_for_or_refused_in_a_line(tmp_path: Path, number: int) -> None:
    random_ = mutators.generator(number)
    name = [*SAMPLES][number % len(SAMPLES)]
    make, start = SAMPLES[name]
    files = make()
    for file, content in files.items():
        (tmp_path / file).write_bytes(content.encode())
    file = random_.choice([*files])
    kind = KINDS[number // len(SAMPLES) % len(KINDS)]
    if file.endswith(".toml"):
        kind = _toml if random_.random() < 0.7 else kind
    if random_.random() < 0.06:
        _other_thing(random_, tmp_path / file)
    else:
        mutated = kind(random_, files[file].encode())
        if random_.random() < 0.2:
            mutated = random_.choice(KINDS[2:4])(random_, mutated)
        (tmp_path / file).write_bytes(mutated)
    try:
        log = read_log(tmp_path / start)
    except ConfigurationError as error:
        message = str(error)
        assert message
        assert message.isprintable(), message
        assert len(message) < 3000
        return
    told = str(contents_of(log))
    assert "Traceback" not in told
    _accounted(log)
    if name in TABLES:
        _all_lines(log, tmp_path, name)
    if name == "modem":
        _same_fixes(log, tmp_path)
    if kind is not _toml and name in ("own", "long", "wide", "capture", "array"):
        _same_ranges(log, tmp_path, name)


def _accounted(log: Log) -> None:
    """Each entry is used, or told of."""
    out = Counter(it.table for it in log.findings if not it.used)
    assert log.entries.get("receptions", 0) == len(log.receptions) + out["receptions"]
    if log.meta.dimension == 3:
        assert log.entries.get("depth", 0) == len(log.depth) + out["depth"]
    fixes = sum(map(len, log.fixes.values()))
    assert log.entries.get("fixes", 0) == fixes + out["fixes"]
    truth = 0 if log.truth is None else len(log.truth.time_ns)
    assert log.entries.get("truth", 0) == truth + out["truth"]
    assert all(it.line > 0 or it.file.endswith(".parquet") for it in log.findings)


def _content(file: Path) -> list[str]:
    """Lines of a file, as editors count them."""
    content = file.read_bytes().decode("utf-8-sig", "replace")
    return re.split("\r\n|\r|\n", content)


def _all_lines(log: Log, folder: Path, name: str) -> None:
    """No line of a table is missing from the entries."""
    tables = {
        "own": {"receptions": ["receptions.csv"], "depth": ["depth.csv"], "truth": ["truth.csv"],
                "fixes": ["fixes.csv"]},
        "long": {"receptions": ["ranges.csv"], "depth": ["depths.csv"]},
        "wide": {"depth": ["wide.csv"]},
        "excerpt": {"fixes": ["acoustic.csv", "global.csv"]},
    }[name]
    if name != "own" and "mapping" not in (folder / "meta.toml").read_text("utf-8", "replace") \
            if (folder / "meta.toml").is_file() else name in ("long", "wide"):
        return
    for table, files in tables.items():
        if table not in log.entries:
            continue
        there = [folder / file for file in files if (folder / file).is_file()]
        lines = [
            line for file in there
            for line in [it for it in _content(file) if it.strip() and not it.startswith("#")][1:]
        ]
        assert log.entries[table] == len(lines), table


def _same_ranges(log: Log, folder: Path, name: str) -> None:
    """A range stands in its line as it is in the log, with its beacon."""
    if not len(log.receptions):
        return
    file = {"own": "receptions.csv", "long": "ranges.csv", "wide": "wide.csv",
            "capture": "dive.jsonl", "array": "dive.json"}[name]
    lines = _content(folder / file)
    head = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    delimiter = max(",;\t", key=head.count)
    for value, line, beacon, time in zip(
        log.receptions.range.tolist(), log.receptions.line.tolist(), log.receptions.beacon,
        log.receptions.arrival_ns.tolist(), strict=True,
    ):
        if name in ("capture", "array"):
            entry = "\n".join(lines[line - 1 : line + 60])
            assert any(_float(it) == value for it in re.findall(r'[^\s,\[\]{}:"]+', entry))
            continue
        (cells,) = csv.reader([lines[line - 1]], delimiter=delimiter)
        words = [cell.strip() for cell in cells]
        if name == "wide":
            column = head.removeprefix("\ufeff").split(delimiter).index(
                "abcd"[int(log.beacons[beacon][1])]
            )
            assert value == _float(words[column])
        else:
            assert value in [_float(word) for word in words]
            assert log.beacons[beacon] in words
        names = head.removeprefix("\ufeff").split(delimiter)
        if name == "own" and "arrival_ns" in names:
            own = words[names.index("arrival_ns")]
            assert own.lower() in ("", "nan") or time == int(float(own)) or time == int(own)


def _same_fixes(log: Log, folder: Path) -> None:
    """East, north and up of the modem stand in a line as they are in the log."""
    lines = _content(folder / "modem.log")
    there = [[_float(it) for it in line.partition("USBLLONG,")[2].split(",")] for line in lines]
    known = {tuple(it[6:9]) for it in there if len(it) == 16}
    for device, fixes in log.fixes.items():
        if device.startswith("USBL "):
            assert {(e, n, -d) for n, e, d in fixes.position.tolist()} <= known


def _float(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
