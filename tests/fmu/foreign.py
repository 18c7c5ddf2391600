"""What the conformance kit says of the FMUs of others: ``python tests/fmu/foreign.py FOLDER``.

It prints the table of `fmus/conformance/FOREIGN.md` for all FMUs below a folder. Nothing of them is
in this repository.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sblcosim.errors import FmuError
from sblcosim.fmus.conformance.kit import Report, examine

DOCUMENT = Path(__file__).parents[2] / "fmus" / "conformance" / "FOREIGN.md"
HEAD = ("FMU", "FMI", "exit", "failed", "warning")


def row(path: Path, folder: Path) -> tuple[str, ...]:
    """Name, version of FMI, exit code, checks that have failed and checks with a warning."""
    name = path.relative_to(folder).as_posix()
    try:
        report = examine(path)
    except FmuError as error:
        return name, "", "2", str(error).removeprefix(f"{path}: "), ""
    code = 1 if not report.ok else 0 if report.blocked is None else 2
    return name, report.fmi, str(code), _of(report, "failed"), _of(report, "warning")


def _of(report: Report, state: str) -> str:
    return ", ".join(result.name for result in report.results if result.state == state)


def line(cells: tuple[str, ...]) -> str:
    """A row of a table in Markdown."""
    return "| " + " | ".join(cells) + " |"


def listed() -> dict[str, tuple[str, ...]]:
    """The rows of the document by the name of the FMU."""
    rows = re.findall(r"^\| (.*\.fmu .*) \|$", DOCUMENT.read_text(), re.MULTILINE)
    cells = [tuple(cell.strip() for cell in row.split("|")) for row in rows]
    return {cell[0]: cell for cell in cells}


if __name__ == "__main__":
    below = Path(sys.argv[1])
    print(line(HEAD), line(("---",) * len(HEAD)), sep="\n")
    for found in sorted(below.rglob("*.fmu")):
        print(line(row(found, below)), flush=True)
