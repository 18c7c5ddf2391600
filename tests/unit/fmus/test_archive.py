"""An FMU is packed completely, and always to the same bytes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from sblcosim.fmus.build.archive import contents, licence, write_fmu
from sblcosim.fmus.standard import Fmi
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
    }


def test_licence_is_the_project_s() -> None:
    assert licence().startswith("MIT License")
