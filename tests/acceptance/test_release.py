"""A release wheel runs scenarios and studies where there is no compiler, no CasADi and no zig."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path
from types import ModuleType

import pytest
from sblcosim.fmus.build import compiler
from sblcosim.fmus.platforms import PLATFORMS, in_folders, this_platform
from sblcosim.models import COMPONENTS
from sblcosim.models.ports import BEACONS
from sblcosim.scenario.tracks import FOLLOWERS

ROOT = Path(__file__).parents[2]
MISSING = ("casadi", "ziglang", "sblcosim", "__editable__")
STUDY = """
scenario = "paper-scenario-1"
replicates = 20

[fixed.time]
duration_s = 10.0

[factors.gps]
keys = ["platform.gps_horizontal_std_m"]
levels = [0.1, 3.5]
"""


def release() -> ModuleType:
    spec = importlib.util.spec_from_file_location("release", ROOT / "tools" / "release.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel whose FMUs are for this machine only, by its own compiler: that is quicker."""
    out = tmp_path_factory.mktemp("dist")
    tool = release()
    pages = tool.pages((4,), (2, 1)) if compiler.zig() else {}
    ready = {**tool.fmus(all_platforms=False, versions=(2,)), **pages}
    tool.wheel(out, compiler.find(), ready)
    (path,) = out.glob("*.whl")
    return path


class Environment:
    """An environment with the wheel and all its dependencies, and nothing else."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        venv.create(folder / "venv", with_pip=False, symlinks=True)
        self.folder = folder
        (self.packages,) = (folder / "venv").glob("lib/python*/site-packages")
        for place in sys.path:
            for entry in Path(place).iterdir() if place.endswith("site-packages") else ():
                target = self.packages / entry.name
                left_out = entry.name.startswith(MISSING) or entry.suffix == ".pth"
                if not left_out and not target.exists():
                    target.symlink_to(entry)
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(self.packages)

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        program = "import sys; from sblcosim.cli import main; sys.argv[0] = 'sblcosim'; main()"
        return subprocess.run(
            [self.folder / "venv" / "bin" / "python", "-I", "-c", program, *arguments],
            cwd=self.folder, text=True, capture_output=True, check=False,
            env={
                "PATH": "/nowhere", "HOME": str(self.folder), "MPLBACKEND": "Agg",
                "SBLCOSIM_CACHE": str(self.folder / "cache"),
            },
        )


@pytest.fixture
def environment(tmp_path: Path, wheel: Path) -> Environment:
    return Environment(tmp_path, wheel)


@pytest.mark.skipif(os.name == "nt", reason="makes links")
def test_wheel_runs_scenarios_and_studies_without_compiler_and_casadi(
    environment: Environment,
) -> None:
    done = environment.run("run", "paper-scenario-1", "--set", "time.duration_s=10", "--out", "out")
    assert done.returncode == 0, done.stderr
    assert (environment.folder / "out" / "record.parquet").is_file()
    assert '"casadi": "not installed"' in (environment.folder / "out" / "manifest.json").read_text()
    (environment.folder / "gps.toml").write_text(STUDY)
    done = environment.run("study", "gps.toml")
    assert done.returncode == 0, done.stderr
    assert "40 runs, 0 failed" in done.stdout
    assert not (environment.folder / "cache").exists()  # nothing was built


@pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
@pytest.mark.skipif(os.name == "nt", reason="makes links")
def test_wheel_explores_without_compiler_and_casadi(environment: Environment) -> None:
    done = environment.run("explore", "realistic-dive", "--beacons", "4", "--no-open")
    assert done.returncode == 0, done.stderr
    assert (environment.folder / "realistic-dive.html").is_file()
    assert not (environment.folder / "cache").exists()  # nothing was built


@pytest.mark.skipif(os.name == "nt", reason="makes links")
def test_changed_model_needs_casadi_and_the_error_says_so(environment: Environment) -> None:
    equations = environment.packages / "sblcosim" / "models" / "target" / "equations.py"
    equations.write_text(equations.read_text() + "\n# changed\n")
    done = environment.run("run", "paper-scenario-1")
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "error: building FMUs needs the package casadi: pip install 'sblcosim[models]'"
    )


@pytest.mark.skipif(compiler.zig() is None, reason="needs ziglang")
@pytest.mark.slow
def test_release_is_a_wheel_for_each_platform_with_fmus_for_all(tmp_path: Path) -> None:
    tool = release()
    subprocess.run([sys.executable, tool.__file__, "--out", tmp_path], check=True)
    wheels = {path.name.removesuffix(".whl").split("-")[-1]: path for path in tmp_path.iterdir()}
    assert set(wheels) == {tool.TAGS[name] for name in PLATFORMS}
    suffixes = {"win": ".dll", "mac": ".dylib", "man": ".so"}
    for tag, path in wheels.items():
        with zipfile.ZipFile(path) as archive:
            ready = [Path(n) for n in archive.namelist() if n.startswith("sblcosim/fmus/ready/")]
            drivers = {p.name for p in ready if p.suffix not in (".fmu", ".sha256", ".wasm")}
            loops = ("native", "lanes_master", "replay", "innovations", "bound")
            assert drivers == {n + suffixes[tag[:3]] for n in loops}
            numbers = range(BEACONS.least, BEACONS.most + 1)
            modules = [f"beacons_{n}_lanes_{lanes}" for n in numbers for lanes in (1, 2)]
            modules += ["bound", *("settings" for _ in numbers)]
            assert sorted(p.stem for p in ready if p.suffix == ".wasm") == sorted(modules)
            fmus = [p for p in ready if p.suffix == ".fmu"]
            names = [*COMPONENTS, *(
                f"{name}{points}" for name, it in FOLLOWERS.items() for points in it.capacities[1:]
            )]
            assert sorted(p.stem for p in fmus) == sorted(2 * names)
            for fmu in fmus:
                with archive.open(fmu.as_posix()) as file, zipfile.ZipFile(file) as inner:
                    places = {n.split("/")[1] for n in inner.namelist() if "binaries/" in n}
                both = [set(in_folders(dict.fromkeys(PLATFORMS, b""), fmi)) for fmi in (2, 3)]
                assert places in both
    environment = Environment(tmp_path / "environment", wheels[tool.TAGS[this_platform()]])
    done = environment.run("run", "paper-scenario-1", "--set", "time.duration_s=10", "--out", "out")
    assert done.returncode == 0, done.stderr
    assert not (environment.folder / "cache").exists()
