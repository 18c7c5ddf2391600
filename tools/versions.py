"""Run the tests with the lowest versions that pyproject.toml declares, and with the newest.

    python tools/versions.py

Each gets a fresh environment, a copy of this tree and an empty cache. Arguments after ``--`` go to
pytest. Both together take half an hour on two cores.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

from tree import ROOT, copy

DEFAULT = ("-n", "auto", "--dist", "loadfile")
RESOLUTIONS = {"lowest": "lowest-direct", "newest": "highest"}


def declared() -> list[str]:
    """Names of all packages that pyproject.toml requires, including those of the tests."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    asked = [extras[name] for name in extras if name != "dev"]
    texts = [*project["dependencies"], *(text for group in asked for text in group)]
    names = {re.match(r"[\w.-]+", text)[0].lower() for text in texts}  # type: ignore[index]
    return sorted(names - {project["name"]})


def environment(folder: Path, resolution: str, interpreter: str) -> tuple[Path, Path]:
    """Make a copy of the tree and an environment for it.

    Returns
    -------
    tuple
        The copy and the environment's Python.
    """
    tree, place = folder / "tree", folder / "environment"
    copy(ROOT, tree)
    tools = folder / "uv"
    subprocess.run([sys.executable, "-m", "venv", str(tools)], check=True)
    (bin_,) = (p for p in (tools / "bin", tools / "Scripts") if p.is_dir())
    subprocess.run([str(bin_ / "python"), "-m", "pip", "install", "--quiet", "uv"], check=True)
    uv = str(bin_ / "uv")
    # pip makes the wheels.
    make = [uv, "venv", "--quiet", "--seed", "--python", interpreter, str(place)]
    subprocess.run(make, check=True)
    python = place / bin_.name / "python"
    subprocess.run(
        [uv, "pip", "install", "--quiet", "--python", str(python), "--resolution", resolution,
         ".[docs,examples,test]"],
        cwd=tree, check=True,
    )  # fmt: skip
    return tree, python


def versions(python: Path, names: Sequence[str]) -> str:
    """Versions of some packages in an environment, as a line."""
    code = (
        "import sys\n"
        "from importlib.metadata import version\n"
        "print('Python', sys.version.split()[0], *(f'{n} {version(n)}' for n in sys.argv[1:]), "
        "sep=', ')"
    )
    done = subprocess.run(
        [str(python), "-c", code, *names], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def examine(bounds: str, interpreter: str, arguments: Sequence[str]) -> bool:
    """Whether all tests pass at one end of the declared versions."""
    with tempfile.TemporaryDirectory(prefix="sblcosim-versions-") as name:
        tree, python = environment(Path(name), RESOLUTIONS[bounds], interpreter)
        print(f"{bounds}: {versions(python, declared())}", flush=True)
        done = subprocess.run(
            [str(python), "-m", "pytest", "-q", *(arguments or DEFAULT)],
            cwd=tree, check=False,
            env=os.environ | {"MPLBACKEND": "Agg", "SBLCOSIM_CACHE": str(Path(name, "cache"))},
        )  # fmt: skip
    return done.returncode == 0


def main() -> int:
    """Both ends, or the requested one; the exit code is 1 if a test fails."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--bounds", choices=RESOLUTIONS, help="default: both")
    parser.add_argument("--python", default=sys.executable, help="interpreter; default: this one")
    parser.add_argument(
        "arguments", nargs="*", help=f"for pytest, after --; default: {' '.join(DEFAULT)}"
    )
    given = parser.parse_args()
    results = {
        bounds: examine(bounds, given.python, given.arguments)
        for bounds in ([given.bounds] if given.bounds else RESOLUTIONS)
    }
    for bounds, passed in results.items():
        print(f"{bounds}: {'all tests pass' if passed else 'tests fail'}")
    return 0 if all(results.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
