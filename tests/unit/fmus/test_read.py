"""Reading FMUs: what is broken or too large is refused in one line, before it costs anything."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from broken_fmus import broken, intact, packed
from sblcosim.fmus.conformance.receiver_contract import check_receiver
from sblcosim.fmus.errors import FmuError
from sblcosim.fmus.read import archive, description
from sblcosim.fmus.read.archive import opened
from sblcosim.fmus.read.ports import Port, read
from seams import Seam

BROKEN = Path(__file__).with_name("broken_fmus.py")
XML = "modelDescription.xml"


def refusal(path: Path, use: Callable[[Path], object] = read) -> str:
    """What is said of a file, without its name."""
    with pytest.raises(FmuError) as caught:
        use(path)
    message = str(caught.value)
    assert message.isprintable()
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


def unpack(path: Path) -> None:
    with opened(path) as fmu:
        fmu.unpack(path.parent / "unpacked")


def edited(tmp_path: Path, was: str, becomes: str, fmi: int = 2) -> Path:
    """An FMU with another description."""
    files = intact(fmi)
    text = files[XML].decode()
    assert was in text
    files[XML] = text.replace(was, becomes, 1).encode()
    path = tmp_path / "edited.fmu"
    path.write_bytes(packed(files))
    return path


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_intact_fmu_is_read(tmp_path: Path, fmi: int) -> None:
    path = tmp_path / "intact.fmu"
    path.write_bytes(packed(intact(fmi)))
    assert set(read(path).ports) >= {"tau", "depth", "position", "epoch", "update_count"}
    assert read(path).ports["position"].shape == (3,)
    check_receiver(path)
    unpack(path)
    assert (tmp_path / "unpacked" / "resources" / "data.txt").read_bytes() == b"0123456789" * 100


def test_what_is_no_file_is_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert refusal(tmp_path / "pipe") == "must be an FMU, got a pipe"
    assert refusal(Path("/dev/zero")) == "must be an FMU, got a device"
    assert refusal(tmp_path) == "must be an FMU, got a folder"
    assert refusal(tmp_path / "none.fmu") == "must be an FMU, got no file"
    with pytest.raises(FmuError, match=r"/xxx.*…: must be an FMU, got File name too long$"):
        read(tmp_path / ("x" * 300))


@pytest.mark.parametrize(
    ("bound", "value", "reason"),
    [
        ("archive_bytes", 1000, "must have at most 1,000 bytes, got "),
        ("archive_files", 3, "must hold at most 3 files, got 4"),
        ("archive_unpacked", 5000, "must have at most 5,000 bytes unpacked, got "),
    ],
)
def test_an_archive_beyond_a_bound_is_refused(
    tmp_path: Path, seam: Seam, bound: str, value: int, reason: str
) -> None:
    path = tmp_path / "large.fmu"
    path.write_bytes(packed(intact(2)))
    seam.tuned(**{bound: value})
    assert reason in refusal(path)


def test_a_sparse_file_and_a_bomb_cost_nothing(tmp_path: Path) -> None:
    path = tmp_path / "sparse.fmu"
    with path.open("wb") as file:
        file.truncate(archive.MAX_FILE + 1)
    assert "must have at most 1,073,741,824 bytes, got 1,073,741,825" in refusal(path)
    bomb = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as fmu:
        for name, content in intact(2).items():
            fmu.writestr(name, content)
        for number in range(11):
            fmu.writestr(f"resources/{number}", bytes(100 << 20), compresslevel=1)
    assert "bytes unpacked, got 1,1" in refusal(bomb)
    assert "bytes unpacked, got 1,1" in refusal(bomb, unpack)
    assert not (tmp_path / "unpacked").exists()


def test_a_description_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "long.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as fmu:
        fmu.writestr(XML, b" " * (archive.MAX_XML + 1))
    assert refusal(path) == f"{XML} must have at most 33,554,432 bytes, got 33,554,433"


def test_a_file_that_is_shorter_or_longer_than_said_is_found(tmp_path: Path) -> None:
    content = packed({XML: intact(2)[XML], "data": b"0123456789"})
    place = content.rindex(b"PK\x01\x02") + 24  # unpacked size in the directory's last entry
    for size in (5, 20):
        path = tmp_path / "lying.fmu"
        path.write_bytes(content[:place] + size.to_bytes(4, "little") + content[place + 4 :])
        assert refusal(path, unpack).startswith("must be an intact ZIP archive, got ")


def with_entry(tmp_path: Path, entry: zipfile.ZipInfo, content: bytes = b"x") -> Path:
    path = tmp_path / "odd.fmu"
    with zipfile.ZipFile(path, "w") as fmu:
        for name, data in intact(2).items():
            fmu.writestr(name, data)
        fmu.writestr(entry, content)
    return path


@pytest.mark.parametrize(
    "name", ["../evil", "/evil", "a/../../evil", "C:evil", "a\\evil", "..", "."]
)
def test_names_that_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    entry = zipfile.ZipInfo("placeholder")
    entry.filename = name
    assert refusal(with_entry(tmp_path, entry)).startswith("must hold names of files inside its")


def test_folders_in_one_another_are_bounded(tmp_path: Path) -> None:
    entry = zipfile.ZipInfo("a/" * 1000 + "x")
    assert refusal(with_entry(tmp_path, entry)).startswith(
        "must hold at most 100 folders in one another, got a/a/"
    )


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR])
def test_links_and_devices_are_refused(tmp_path: Path, kind: int) -> None:
    entry = zipfile.ZipInfo("resources/link")
    entry.external_attr = (kind | 0o777) << 16
    path = with_entry(tmp_path, entry, b"/etc/passwd")
    assert refusal(path) == (
        "must hold files and folders only, got a link or device resources/link"
    )


def test_a_file_in_place_of_a_folder_is_an_error_of_unpacking(tmp_path: Path) -> None:
    entry = zipfile.ZipInfo("resources/data.txt/more")
    reason = refusal(with_entry(tmp_path, entry), unpack)
    assert reason.startswith("must be possible to unpack, got ")


def patched(tmp_path: Path, offset: int, value: int, size: int = 2) -> Path:
    """An FMU with another number in the headers of the description."""
    content = bytearray(packed(intact(2)))
    local, central = content.index(b"PK\x03\x04"), content.index(b"PK\x01\x02")
    for place in (local + offset - 2, central + offset):
        content[place : place + size] = value.to_bytes(size, "little")
    path = tmp_path / "patched.fmu"
    path.write_bytes(content)
    return path


def test_broken_archives_are_named(tmp_path: Path) -> None:
    assert refusal(patched(tmp_path, 8, 0x1)) == (f"must not be encrypted, got {XML} encrypted")
    for method in (12, 14, 99):
        assert refusal(patched(tmp_path, 10, method)).endswith(f"got method {method} for {XML}")
    assert "Bad CRC-32" in refusal(patched(tmp_path, 16, 1, 4))
    whole = packed(intact(2))
    path = tmp_path / "cut.fmu"
    path.write_bytes(whole[:60] + bytes(40) + whole[100:])
    assert "must be an intact ZIP archive, got " in refusal(path)
    path.write_bytes(whole[: len(whole) // 2])
    assert refusal(path) == "is not an FMU (not a ZIP archive)"
    size = 17 << 20
    path.write_bytes(bytes(size) + b"PK\5\6" + bytes(8) + size.to_bytes(4, "little") + bytes(6))
    assert refusal(path) == "must be an intact ZIP archive, got a directory of 17,825,792 bytes"


@pytest.mark.parametrize(
    ("was", "becomes", "reason"),
    [
        ('encoding="UTF-8"', 'encoding="nonsense"', "must be well-formed XML, got unknown encod"),
        ('valueReference="3"', 'valueReference="-1"', "value reference is not from 0 to 2^32 - 1"),
        ('valueReference="3"', 'valueReference="4294967296"', "value reference is not from 0"),
        ('min="0.1"', 'min="low"', "its min is no number: low"),
        ('start="1"', 'start="one"', "its start is no number of type Real: one"),
        ('start="1"', 'start="1 2"', "its start has 2 values for 1 elements"),
        ('stopTime="10"', 'stopTime="end"', "stopTime of the default experiment is no number"),
        ('identifier="planted"', "", "modelIdentifier is no file name:"),
        ('identifier="planted"', 'identifier="../x"', "modelIdentifier is no file name: ../x"),
        ("<Integer/>", '<Integer start="99999999999"/>', "is out of the range of Integer"),
        ("?>", "?><!DOCTYPE x [<!ENTITY a 'aaaa'>]>", "XML without a document type declaration"),
        ("<UnitDefinitions>", "<UnitDefinitions>" + "<a>" * 101, "nested at most 100 elements"),
        ('<Unit name="m">', "<a/>" * 2_000_000 + '<Unit name="m">', "at most 2,000,000 elements"),
        ('dependencies=""', f'dependencies="{"1 " * 2_000_000}"', "at most 2,000,000 elements"),
    ],
)
def test_broken_descriptions_are_named(tmp_path: Path, was: str, becomes: str, reason: str) -> None:
    was = was.replace("identifier", "modelIdentifier")
    path = edited(tmp_path, was, becomes.replace("identifier=", "modelIdentifier="))
    for use in (read, check_receiver):
        message = refusal(path, use)
        assert message.startswith("modelDescription.xml must be ")
        assert reason in message


RANGES = {
    "Int8": (-128, 127), "UInt8": (0, 255), "Int16": (-32_768, 32_767), "UInt16": (0, 65_535),
    "Int32": (-2_147_483_648, 2_147_483_647), "UInt32": (0, 4_294_967_295),
    "Int64": (-9_223_372_036_854_775_808, 9_223_372_036_854_775_807),
    "UInt64": (0, 18_446_744_073_709_551_615),
    "Enumeration": (-9_223_372_036_854_775_808, 9_223_372_036_854_775_807),
}  # fmt: skip
"""Of the types of FMI 3 that are whole numbers."""


@pytest.mark.parametrize("kind", RANGES)
def test_starts_are_within_the_range_of_their_type(tmp_path: Path, kind: str) -> None:
    declared = ' declaredType="E"' if kind == "Enumeration" else ""
    low, high = RANGES[kind]
    for value, allowed in ((low - 1, False), (low, True), (high, True), (high + 1, False)):
        was = "<ModelVariables>"
        becomes = f'''<TypeDefinitions><EnumerationType name="E"><Item name="a" value="1"/>
            </EnumerationType></TypeDefinitions>{was}<{kind} name="n"{declared} valueReference="90"
            causality="parameter" variability="fixed" start="{value}"/>'''
        path = edited(tmp_path, was, becomes, fmi=3)
        if allowed:
            with opened(path) as fmu:
                found = {v.name: v for v in description.describe(fmu).modelVariables}["n"]
            assert (found.type, found.start) == (kind, str(value))
        else:
            assert f"its start is out of the range of {kind}: {value}" in refusal(path)


@pytest.mark.parametrize(
    ("dimension", "reason"),
    [
        ('start="99999999999"', "a dimension is not from 0 to 1,000,000: 99999999999"),
        ('start="-1"', "a dimension is not from 0 to 1,000,000: -1"),
        ('start="2000"/><Dimension start="2000"', "it has more than 1,000,000 elements"),
        ('valueReference="77"', "must be valid, got: 77"),
    ],
)
def test_huge_arrays_are_refused(tmp_path: Path, dimension: str, reason: str) -> None:
    was = 'causality="output" unit="m"/>'
    becomes = f'causality="output" unit="m"><Dimension {dimension}/></Float64>'
    assert reason in refusal(edited(tmp_path, was, becomes, fmi=3))


def test_the_elements_of_all_arrays_count(tmp_path: Path, seam: Seam) -> None:
    path = edited(tmp_path, "<Integer/>", "<Integer />")
    seam.tuned(elements=6)
    assert "variable update_count: more than 6 elements of all variables" in refusal(path)
    seam.tuned(elements=7)
    seam.tuned(variables=6)
    assert "7 variables, more than 6" in refusal(path)


@pytest.mark.parametrize("index", ["99999999999", "999999999", "9" * 5000, "0", "4"])
def test_an_index_without_its_array_is_the_name_of_a_scalar(tmp_path: Path, index: str) -> None:
    path = edited(tmp_path, "position[3]", f"position[{index}]")
    name = f"position[{index}]"
    assert read(path).ports[name].shape == ()
    assert not check_receiver(path).ok


def test_terminals_within_the_same_bounds(tmp_path: Path) -> None:
    files = intact(2)
    for content, reason in (
        (b"<broken", "must be well-formed XML"),
        (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
    ):
        path = tmp_path / "terminals.fmu"
        path.write_bytes(packed(files | {"terminalsAndIcons/terminalsAndIcons.xml": content}))
        for use in (read, check_receiver):
            assert reason in refusal(path, use)


def test_an_equal_seed_breaks_an_fmu_equally() -> None:
    assert broken(5) == broken(5) != broken(6)


@pytest.mark.parametrize("count", [300, pytest.param(20_000, marks=pytest.mark.slow)])
def test_broken_fmus_are_refused_or_read(count: int) -> None:
    first = int(os.environ.get("SBLCOSIM_FUZZ_SEED", "0"))
    command = [sys.executable, "-W", "ignore", BROKEN, str(first), str(count)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_what_is_just_within_the_bounds_is_read_in_a_gigabyte(tmp_path: Path) -> None:
    path = tmp_path / "large.fmu"
    variables = "".join(
        f'<ScalarVariable name="x{i}" valueReference="{i}" causality="output" variability='
        '"continuous" initial="exact"><Real start="0" unit="m" min="0" max="1"/></ScalarVariable>'
        for i in range(20_000)
    )
    text = intact(2)[XML].decode().replace("</ModelVariables>", f"{variables}</ModelVariables>")
    path.write_bytes(packed(intact(2) | {XML: text.encode()}))
    code = (
        "import resource, sys; from pathlib import Path; from sblcosim.fmus.read.ports import read;"
        "resource.setrlimit(resource.RLIMIT_DATA, (10**9, 10**9)); read(Path(sys.argv[1]))"
    )
    subprocess.run([sys.executable, "-c", code, path], check=True)


@pytest.mark.parametrize("size", [0, 1, 3])
def test_arrays_with_names_of_elements_do_not_make_up_another_array(
    size: int, tmp_path: Path
) -> None:
    was = "<ModelVariables>"

    def ports(*indices: int, dimension: str) -> Mapping[str, Port]:
        own = "".join(
            f'<Float64 name="x[{index}]" valueReference="9{index}" causality="output"'
            f">{dimension}</Float64>" for index in indices
        )
        return read(edited(tmp_path, was, was + own, fmi=3)).ports

    arrays = ports(1, 2, dimension=f'<Dimension start="{size}"/>')
    assert [(name, port.shape) for name, port in arrays.items() if name.startswith("x")] == [
        ("x[1]", (size,)), ("x[2]", (size,)),
    ]  # fmt: skip
    scalars = ports(2, 1, dimension="")
    assert [name for name in scalars if name.startswith("x")] == ["x"]
    assert scalars["x"].references == (91, 92)
