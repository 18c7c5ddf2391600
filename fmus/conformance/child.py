"""The process of one step of one check: ``python -m …child FOLDER CHECK STEP FIRST_PROBE``."""

from __future__ import annotations

import json
import os
import pickle
import sys
from pathlib import Path

from .checks import CHECKS, Bench, ConformanceError, NotApplicableError
from .host import MissingError, RefusedError, Trace


def main(folder: Path, name: str, step: int, first: int) -> None:
    """Run the step and leave its result in a file; a crash leaves none."""
    try:  # a crash is what we wait for: its core is of no use
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except ImportError:
        pass
    trace = Trace(folder / "trace")
    subject = pickle.loads((folder / "subject").read_bytes())
    check = next(check for check in CHECKS if check.name == name)
    try:
        state, reason = "passed", check.steps[step](Bench(subject, folder, trace, first))
    except (ConformanceError, MissingError, RefusedError) as problem:
        state, reason = "failed", str(problem)
    except NotApplicableError as problem:
        state, reason = "does not apply", str(problem)
    except OSError as error:  # what ctypes makes of a crash on Windows
        state, reason = "failed", f"crashed: {error}"
    (folder / "result").write_text(json.dumps([state, reason]))
    # What the FMU does at the end of a process is not asked.
    os._exit(0)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
