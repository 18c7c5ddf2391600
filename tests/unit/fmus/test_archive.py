"""An FMU is packed completely, and always to the same bytes."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from sblcosim.fmus.build.archive import contents, licence, pack, write_fmu
from sblcosim.fmus.build.description import terminals
from sblcosim.fmus.build.documentation import index_html
from sblcosim.fmus.known_as import KNOWN_AS
from sblcosim.fmus.platforms import this_platform
from sblcosim.fmus.read.ports import read
from sblcosim.fmus.standard import Fmi
from sblcosim.fmus.terminals import PORTS, TERMINALS
from sblcosim.models.loading import load

FILES = {
    "sources/b.h": b"int b;\n" * 100,
    "modelDescription.xml": b"<xml/>",
    "binaries/linux64/A.so": bytes(range(256)),
    "documentation/index.html": b"",
}


def test_equal_files_in_any_order_give_equal_bytes(tmp_path: Path) -> None:
    write_fmu(tmp_path / "a.fmu", FILES)
    write_fmu(tmp_path / "b.fmu", dict(reversed(FILES.items())))
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()


def test_archive_holds_the_files_with_the_description_first(tmp_path: Path) -> None:
    write_fmu(tmp_path / "deep" / "a.fmu", FILES)
    with zipfile.ZipFile(tmp_path / "deep" / "a.fmu") as archive:
        names = archive.namelist()
        assert {name: archive.read(name) for name in names} == FILES
        assert names == ["modelDescription.xml", *sorted(FILES.keys() - {"modelDescription.xml"})]
        for entry in archive.infolist():
            assert entry.date_time == (1980, 1, 1, 0, 0, 0)
            assert entry.compress_type == zipfile.ZIP_DEFLATED
            assert entry.extract_version <= 20
            executable = entry.filename.startswith("binaries/")
            assert entry.external_attr >> 16 == (0o100755 if executable else 0o100644)


def test_failed_write_leaves_the_old_archive_and_no_remains(tmp_path: Path) -> None:
    write_fmu(tmp_path / "a.fmu", FILES)
    before = (tmp_path / "a.fmu").read_bytes()
    with pytest.raises(TypeError):
        write_fmu(tmp_path / "a.fmu", FILES | {"sources/z.c": None})  # type: ignore[dict-item]
    assert (tmp_path / "a.fmu").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.fmu"]


@pytest.mark.parametrize(("fmi", "folder"), [(2, "win64"), (3, "x86_64-windows")])
def test_contents_have_their_places(fmi: Fmi, folder: str) -> None:
    sources = {"model.c": b"1", "model.h": b"2"}
    files = contents(load("range_model"), fmi, "token", sources, {"x86_64-windows": b"3"})
    assert files[f"binaries/{folder}/RangeModel.dll"] == b"3"
    assert files["sources/model.h"] == b"2"
    assert files["documentation/licenses/license.txt"] == licence().encode()
    assert b"model.h" not in files["sources/buildDescription.xml"]
    assert files.keys() == {
        "modelDescription.xml",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "sources/buildDescription.xml",
        "sources/model.c",
        "sources/model.h",
        f"binaries/{folder}/RangeModel.dll",
        KNOWN_AS,
    }


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", ["platform", "acoustics", "ekf", "range_model"])
def test_runs_know_an_fmu_by_what_counts_in_it(name: str, fmi: Fmi, tmp_path: Path) -> None:
    """Neither its copyright does, nor a terminal that names no port of a receiver."""
    model, sources = load(name), {"model.c": b"1"}
    binary = {this_platform(): b"3"}
    whole = dict(contents(model, fmi, "{token}", sources, binary))
    path = tmp_path / "whole.fmu"
    write_fmu(path, whole)
    line = next(line for line in licence().splitlines() if line.startswith("Copyright"))
    stated = f' copyright="{line}"'.encode()
    assert whole["modelDescription.xml"].count(stated) == 1

    plain = {file: content for file, content in whole.items() if file != KNOWN_AS}
    plain["modelDescription.xml"] = plain["modelDescription.xml"].replace(stated, b"")
    ports = tuple(t for t in model.component.terminals if t.kind in PORTS)
    less = replace(model, component=replace(model.component, terminals=ports))
    plain["documentation/index.html"] = index_html(less, fmi).encode()
    if not ports:
        plain.pop(TERMINALS, None)
    else:
        plain[TERMINALS] = terminals(less, fmi) or b""
    known_as = read(path).known_as
    assert known_as == hashlib.sha256(pack(plain)).hexdigest() != read(path).sha256

    for file in whole.keys() - {KNOWN_AS}:  # whatever is changed by others, it is another FMU
        other = tmp_path / "other.fmu"
        write_fmu(other, whole | {file: whole[file] + b" "})
        assert read(other).known_as == read(other).sha256, file
    write_fmu(other, whole | {"resources/more": b""})
    assert read(other).known_as == read(other).sha256
    write_fmu(other, {**whole, KNOWN_AS: whole[KNOWN_AS].ljust(2000)})
    assert read(other).known_as == read(other).sha256


def test_licence_is_the_project_s() -> None:
    assert licence().startswith("MIT License")
