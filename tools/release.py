"""Make the wheels of a release, which include ready-made FMUs and drivers.

    python tools/release.py --out dist

There is one wheel per platform, because the drivers and the bound are specific to it; the FMUs in
each wheel are for all platforms, and so are the modules of WebAssembly for pages. Installing such a
wheel needs neither a compiler nor CasADi, unless a model is changed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from sblcosim.explore.contents import ready as pages
from sblcosim.fmus.build import bound, compiler, factory
from sblcosim.fmus.files import write_sealed
from sblcosim.fmus.platforms import PLATFORMS
from sblcosim.identification import innovations
from sblcosim.models import COMPONENTS, file_name
from sblcosim.scenario.tracks import FOLLOWERS
from sblcosim.simulation.masters import c_libraries, lanes_driver, native, replay

ROOT = Path(__file__).parents[1]
SOURCES = ("orchestrator", "models", "fmus", "pyproject.toml", "README.md", "LICENSE")
TAGS = {
    "x86_64-linux": "manylinux_2_17_x86_64",
    "aarch64-linux": "manylinux_2_17_aarch64",
    "x86_64-windows": "win_amd64",
    "x86_64-darwin": "macosx_11_0_x86_64",
    "aarch64-darwin": "macosx_11_0_arm64",
}
"""Platform tags of wheels; the versions are those of `ZIG_TARGETS`."""


def fmus(all_platforms: bool = True, versions: Iterable[int] = (2, 3)) -> dict[str, Path]:
    """All our FMUs, built, by their place among the ready-made files."""
    made: list[tuple[str, dict[str, int]]] = [(name, {}) for name in COMPONENTS]
    made += [
        (name, {it.constant.name: points})
        for name, it in FOLLOWERS.items() for points in it.capacities[1:]
    ]
    wanted = [
        factory.Wanted(name, fmi, all_platforms, constants=constants)
        for fmi in versions
        for name, constants in made
    ]
    places = [
        f"{factory.key(w.name, w.fmi, **w.constants)}/"
        f"{file_name(w.name, **w.constants)}.fmu"
        for w in wanted
    ]
    return dict(zip(places, factory.build_all(wanted), strict=True))


def wheel(out: Path, cc: compiler.Compiler, ready: Mapping[str, Path]) -> None:
    """Write the wheel for a compiler's platform.

    Parameters
    ----------
    ready
        Files to include besides the drivers, by their place.
    """
    made = dict(ready)
    for driver in (native.DRIVER, lanes_driver.DRIVER, replay.DRIVER, innovations.DRIVER):
        file = c_libraries.library(driver, cc)
        made[f"{c_libraries.key(driver, cc.platform)}/{file.name}"] = file
    file = bound.library(cc)
    made[f"{bound.key(cc.platform)}/{file.name}"] = file
    with tempfile.TemporaryDirectory(prefix="sblcosim-release-") as name:
        source = Path(name)
        for entry in SOURCES:
            if (ROOT / entry).is_dir():
                skip = shutil.ignore_patterns("__pycache__", "ready")
                shutil.copytree(ROOT / entry, source / entry, ignore=skip)
            else:
                shutil.copyfile(ROOT / entry, source / entry)
        for place, file in made.items():
            target = source / "fmus" / factory.READY.name / place
            write_sealed(target, file.read_bytes())
        subprocess.run(
            [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
             f"--config-settings=--build-option=--plat-name={TAGS[cc.platform]}",
             "--wheel-dir", str(out), str(source)],
            check=True,
        )


def main() -> None:
    """Make all wheels, or the requested ones."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("dist"), help="folder for the wheels")
    parser.add_argument(
        "--platform", action="append", choices=PLATFORMS, help="may be repeated; default: all"
    )
    arguments = parser.parse_args()
    ready = {**fmus(), **pages()}
    for cc in compiler.for_every_platform():
        if cc.platform in (arguments.platform or PLATFORMS):
            wheel(arguments.out, cc, ready)
    print(*sorted(arguments.out.glob("*.whl")), sep="\n")


if __name__ == "__main__":
    main()
