"""What a machine lacks is told from what is wrong with an FMU, by the words of loaders and FMUs."""

from __future__ import annotations

from pathlib import Path

import pytest
from sblcosim.fmus.conformance.environment import of_loader, of_log


@pytest.mark.parametrize(("text", "expected"), [
    ("libstdc++.so.6: cannot open shared object file: No such file or directory",
     "it needs libstdc++.so.6, which is not on this machine"),
    ("/lib/x86_64-linux-gnu/libc.so.6: version `GLIBC_2.38' not found (required by /tmp/a.so)",
     "it needs GLIBC_2.38, and the system's library is older"),
    ("/tmp/a.so: undefined symbol: PyExc_ValueError",
     "it needs PyExc_ValueError of a Python interpreter's library"),
    ("/tmp/a.so: failed to map segment from shared object",
     "programs may not be run from the folder for temporary files"),
    ("dlopen(/tmp/a.dylib, 0x0006): Library not loaded: @rpath/libfoo.1.dylib",
     "it needs @rpath/libfoo.1.dylib, which is not on this machine"),
    ("[WinError 126] The specified module could not be found",
     "it needs another library, which is not on this machine"),
    ("Could not find module 'a.dll' (or one of its dependencies). Try using the full path",
     "it needs another library, which is not on this machine"),
    ("/tmp/a.so: undefined symbol: solve", None),
    ("/tmp/a.so: invalid ELF header", None),
    ("/tmp/a.so: wrong ELF class: ELFCLASS32", None),
    ("[WinError 193] %1 is not a valid Win32 application", None),
])  # fmt: skip
def test_loaders_say_what_is_missing(text: str, expected: str | None, tmp_path: Path) -> None:
    assert of_loader(text, tmp_path) == expected


def test_a_library_in_the_fmu_is_not_missing(tmp_path: Path) -> None:
    text = "libfoo.so: cannot open shared object file: No such file or directory"
    (tmp_path / "documentation").mkdir()
    (tmp_path / "documentation" / "externalDependencies.txt").write_text("libfoo")
    assert str(of_loader(text, tmp_path)).endswith(
        "; see documentation/externalDependencies.txt in the FMU"
    )
    (tmp_path / "resources").mkdir()
    (tmp_path / "resources" / "libfoo.so").write_bytes(b"")
    assert of_loader(text, tmp_path) is None


@pytest.mark.parametrize(("text", "expected"), [
    ("License checkout failed: 27000@keys.example is down (-15,570)", "a licence is missing"),
    ("FLEXnet Licensing error", "a licence is missing"),
    ("Keine gültige Lizenz gefunden", "a licence is missing"),
    ("no valid licence found, FMU will not be initialized", "a licence is missing"),
    ("ModuleNotFoundError: No module named 'scipy'", "a Python module is missing"),
    ("libjvm.so: cannot open shared object file", "a shared library is missing"),
    ("connect: Connection refused", "a server is missing"),
    ("Could not find a Java runtime", "something is missing"),
    ("Python interpreter not found", "something is missing"),
    ("sh: octave: command not found", "something is missing"),
    ("cannot connect to X server / display :0", "something is missing"),
    ("MATLAB Runtime R2022b is not installed", "something is missing"),
    ("", None),
    ("gain must not be negative, got -1", None),
    ("fmi2SetReal: unknown value reference 5", None),
    ("nonlinear system 12 fails: the solver did not converge", None),
    ("division by zero at time 0.5", None),
    ("fmi2ExitInitializationMode: Illegal call sequence.", None),
    ("Wrong GUID {a}, expected {b}", None),
])  # fmt: skip
def test_fmus_say_what_is_missing(text: str, expected: str | None) -> None:
    assert of_log(text) == expected
