"""Changes of files, from a random generator: of text, TOML, JSON, XML, archives, any bytes.

The cases of a test come from a seed. Any number of them, and one again:

    SBLCOSIM_MUTATION_CASES=5000 pytest -n auto tests/robustness/test_mutated_inputs.py
    SBLCOSIM_MUTATION_SEED=7 pytest tests/robustness/test_mutated_packages.py -k case00042
"""

from __future__ import annotations

import copy
import io
import json
import os
import random
import re
import warnings
import zipfile
from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree

import pytest

Random = random.Random
SEED = int(os.environ.get("SBLCOSIM_MUTATION_SEED", "1"))


def cases(quick: int, most: int | None = None) -> pytest.MarkDecorator:
    """Give a test the parameter ``number``; the cases after the quick ones are slow."""
    asked = os.environ.get("SBLCOSIM_MUTATION_CASES")
    return pytest.mark.parametrize("number", [
        pytest.param(n, id=f"case{n:05}", marks=[] if asked or n < quick else pytest.mark.slow)
        for n in range(int(asked or most or quick))
    ])  # fmt: skip


def generator(number: int) -> Random:
    """The random generator of a case."""
    return Random(f"{SEED} {number}")


WORDS = [
    "", " ", "x", "nan", "inf", "-1", "0", "1e308", "1e-320", "true", "'a'", "/dev/zero", "/",
    "..", "../../x", "C:\\", "é", "$\\frac{", "é°\u202e", "\x00", "\n", "%s%n", "-", "--help",
    "a" * 3000, "a/" * 2000, "[" * 200, "9" * 5000, "\ud7ff", "#", '"', "{{ x }}", "<b>", "ekf",
    "raw",
]  # fmt: skip
"""Texts that programs stumble over."""
NUMBERS = [
    "0", "-0.0", "-1", "1", "2", "64", "65", "0.1", "1e-9", "1e-300", "1e300", "1e308", "1e999",
    "nan", "-inf", "inf", "2147483647", "2147483648", "-2147483649", "4294967296",
    "9223372036854775807", "9223372036854775808", "18446744073709551616", "9" * 400, "0x10",
    "1_000", "0.30000000000000004", "1e-5", "3.0000000001",
]  # fmt: skip
OUTSIDE = ("/tmp/sblcosim-evil-1", "/tmp/sblcosim-evil-2")
"""Where archives want to write to."""


def damaged(random_: Random, content: bytes) -> bytes:
    """Any bytes: flipped, overwritten, cut, repeated, exchanged."""
    data = bytearray(content)
    if not data:
        return b"x"
    place = random_.randrange(len(data))
    size = min(random_.choice([1, 1, 4, 64, 4096]), len(data) - place)
    match random_.randrange(8):
        case 0 | 1:
            data[place] ^= 1 << random_.randrange(8)
        case 2:
            data[place : place + size] = random_.randbytes(size)
        case 3:
            data[place : place + size] = bytes(size)
        case 4:
            del data[place:]
        case 5:
            del data[place : place + size]
        case 6:
            data[place:place] = data[place : place + size]
        case 7:
            return random_.choice([b"", b"\0", b"PK\x03\x04", content * 2, random_.randbytes(100)])
    return bytes(data)


def text(random_: Random, content: str) -> str:
    """Any text: characters, lines and words of it."""
    lines = content.splitlines(keepends=True) or [""]
    i, j = random_.randrange(len(lines)), random_.randrange(len(lines))
    match random_.randrange(6):
        case 0:
            del lines[i]
        case 1:
            lines.insert(i, lines[j])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            lines = lines[:i]
        case 4:
            at = random_.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + random_.choice(WORDS) + lines[i][at:]
        case 5:
            words = lines[i].split(" ")
            words[random_.randrange(len(words))] = random_.choice(WORDS + NUMBERS)
            lines[i] = " ".join(words)
    return "".join(lines)


def toml(random_: Random, content: str) -> str:
    """A TOML file: values, keys, tables; or just as text."""
    lines = content.splitlines()
    keys = [i for i, line in enumerate(lines) if re.match(r"[\w.\"]+ *=", line)]
    tables = [i for i, line in enumerate(lines) if line.startswith("[")]
    if not keys or random_.random() < 0.15:
        return text(random_, content)
    i = random_.choice(keys)
    key, _, value = lines[i].partition("=")
    match random_.randrange(10):
        case 0 | 1 | 2 | 3:
            lines[i] = f"{key}= {toml_value(random_, value.strip())}"
        case 4:
            lines[i] = f"{key} = {toml_value(random_, value.strip())}"
            lines.insert(random_.choice(keys), random_.choice(lines))
        case 5:
            lines[i] = f"{_key(random_, key.strip())} ={value}"
        case 6 if tables:
            j = random_.choice(tables)
            lines[j] = f"[{_key(random_, lines[j].strip('[]'))}]"
        case 7:
            del lines[i]
        case 8 if tables:
            lines.insert(random_.choice(tables), f"{_key(random_, key.strip())} ={value}")
        case _:
            deep = random_.choice([10, 1000, 100_000])
            lines[i] = f"{key}= " + random_.choice(
                ["[" * deep + "]" * deep, "{a=" * deep + "1" + "}" * deep, f"1{'.a' * deep}"]
            )
    return "\n".join(lines) + "\n"


def toml_value(random_: Random, before: str) -> str:
    """Something in place of a value."""
    return random_.choice([
        lambda: random_.choice(NUMBERS),
        lambda: json.dumps(random_.choice(WORDS)),
        lambda: random_.choice(["true", "false", "1979-05-27", "07:32:00", "[]", "{}", "[[]]"]),
        lambda: f"[{before}]",
        lambda: f"[{', '.join([before] * random_.choice([1, 3, 100]))}]",
        lambda: f"{{ a = {before} }}",
        lambda: f"-{before}",
        lambda: before + random_.choice(["0", "e9", "e-9", "_", " ", "]"]),
        lambda: json.dumps(before.strip('"')[::-1]),
    ])()  # fmt: skip


def _key(random_: Random, before: str) -> str:
    return random_.choice([
        before + "x", before[:-1], before.upper(), f"{before}.{before}", json.dumps(before),
        ".".join(["a"] * random_.choice([2, 50, 3000])), json.dumps(random_.choice(WORDS)), "",
    ])  # fmt: skip


def as_json(random_: Random, content: str) -> str:
    """A JSON file that stays one: a value somewhere in it; or just as text."""
    if random_.random() < 0.2:
        return text(random_, content)
    whole = json.loads(content)
    holders: list[tuple[Any, Any]] = []

    def look(value: Any) -> None:
        entries = value.items() if isinstance(value, dict) else enumerate(value)
        for key, below in entries:
            holders.append((value, key))
            if isinstance(below, dict | list):
                look(below)

    look(whole)
    holder, key = random_.choice(holders)
    others: list[Any] = [
        None, True, 0, -1, 1.5, 10**30, 10**4000, "", "x", [], {}, [[]], {"a": 1}, "a" * 3000,
        float("nan"), float("inf"),
    ]  # fmt: skip
    match random_.randrange(5):
        case 0 | 1:
            holder[key] = random_.choice(others)
        case 2:
            return json.dumps(whole).replace("1", "1" * 5000, 1)
        case 3:
            del holder[key]
        case 4:
            other, place = random_.choice(holders)
            holder[key] = json.loads(json.dumps(other[place]))
    return json.dumps(whole)


def xml(random_: Random, content: str) -> str:
    """An XML file: attributes, elements, the head; or just as text."""
    attributes = list(re.finditer(r'([\w:.-]+)="([^"]*)"', content))
    elements = list(re.finditer(r"<(\w+)[^<>]*/>", content))
    kind = random_.randrange(10)
    if kind < 5 and attributes:
        found = random_.choice(attributes)
        new = random_.choice([
            lambda: random_.choice(NUMBERS),
            lambda: random_.choice(WORDS).replace('"', "").replace("<", "").replace("\0", ""),
            lambda: random_.choice(attributes)[2],
            lambda: found[2] + random_.choice(["0", "[1]", "[99999999999]", " "]),
        ])()  # fmt: skip
        return content[: found.start(2)] + new + content[found.end(2) :]
    if kind == 5 and attributes:
        found = random_.choice(attributes)
        return content[: found.start()] + content[found.end() :]
    if kind == 6 and elements:
        found = random_.choice(elements)
        again = random_.choice([0, 2, 50])
        return content[: found.start()] + found[0] * again + content[found.end() :]
    if kind == 7:
        return re.sub(r"encoding=\"[^\"]*\"", f'encoding="{random_.choice(WORDS[:12])}"', content)
    if kind == 8:
        bomb = "".join(
            f'<!ENTITY x{n + 1} "{f"&x{n};" * 10}">' for n in range(9)
        )  # a billion times x0
        head, _, rest = content.partition("?>")
        name = re.search(r"<(\w+)", rest)
        root = name[1] if name else "x"
        body = re.sub(r'description="[^"]*"', 'description="&x9;"', rest, count=1)
        return f'{head}?><!DOCTYPE {root} [<!ENTITY x0 "x">{bomb}]>{body}'
    return text(random_, content)


def elements(random_: Random, content: str) -> str:
    """An XML file that stays one: elements away, twice or elsewhere; attributes exchanged."""
    root = ElementTree.fromstring(content)
    within = [(parent, child) for parent in root.iter() for child in parent]
    if not within:
        return text(random_, content)
    parent, child = random_.choice(within)
    attributes = [(e, key) for e in root.iter() for key in e.attrib]
    match random_.randrange(6):
        case 0:
            parent.remove(child)
        case 1:
            parent.insert(random_.randrange(len(parent) + 1), copy.deepcopy(child))
        case 2:
            parent.remove(child)
            random_.choice([*root.iter()]).append(child)
        case _ if attributes:
            one, key = random_.choice(attributes)
            other, again = random_.choice([(e, k) for e, k in attributes if k == key])
            one.attrib[key], other.attrib[again] = other.attrib[again], one.attrib[key]
    return ElementTree.tostring(root, encoding="unicode")


def archive(random_: Random, content: bytes, change: Mapping[str, Callable[..., str]]) -> bytes:
    """A ZIP archive: an entry of it, its names, its records; or just as bytes.

    Parameters
    ----------
    change
        How entries are mutated whose names end so; others as bytes.
    """
    kind = random_.randrange(10)
    if kind < 2:
        return damaged(random_, content)
    if kind == 2:
        return _records(random_, content)
    entries: list[tuple[str, bytes]] = []
    with zipfile.ZipFile(io.BytesIO(content)) as source:
        entries = [(name, source.read(name)) for name in source.namelist()]
    preferred = [i for i, (name, _) in enumerate(entries) if name == "modelDescription.xml"]
    i = preferred[0] if kind < 7 and preferred else random_.randrange(len(entries))
    name, data = entries[i]
    if kind < 8:
        suffix = next((s for s in change if name.endswith(s)), None)
        if suffix is None:
            entries[i] = (name, damaged(random_, data))
        else:
            mutated = change[suffix](random_, data.decode())
            entries[i] = (name, mutated.encode(errors="surrogatepass"))
    elif kind == 8:
        del entries[i]
    else:
        evil = random_.choice([
            "../evil", "../" * 30 + OUTSIDE[0][1:], OUTSIDE[1], "binaries/../../evil", name,
            name.upper(), "a" * 300, "a/" * 1000 + "x", "evil\\..\\x", "modelDescription.xml/x", "",
            "binaries", "é\u202e",
        ])  # fmt: skip
        entries.append((evil, data))
    made = io.BytesIO()
    method = random_.choice([zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED])
    with warnings.catch_warnings(), zipfile.ZipFile(made, "w", method) as target:
        warnings.simplefilter("ignore")  # a name that is there twice is meant
        for name, data in entries:
            info = zipfile.ZipInfo(name or "x", (1980, 1, 1, 0, 0, 0))
            info.compress_type = method
            if random_.random() < 0.02:
                info.external_attr = 0o120777 << 16  # a symbolic link
            target.writestr(info, data)
    return made.getvalue()


def _records(random_: Random, content: bytes) -> bytes:
    """A field of an entry's record in the archive: method, flags, sizes, CRC."""
    data = bytearray(content)
    marks = [m.start() for m in re.finditer(rb"PK\x01\x02", content)]
    if not marks:
        return damaged(random_, content)
    mark = random_.choice(marks)
    place, size = random_.choice([(8, 2), (10, 2), (16, 4), (20, 4), (24, 4), (28, 2), (42, 4)])
    value = random_.choice([0, 1, 8, 14, 99, (1 << 8 * size) - 1, random_.getrandbits(8 * size)])
    data[mark + place : mark + place + size] = value.to_bytes(size, "little")
    return bytes(data)
