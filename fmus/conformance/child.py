"""The process of one step of one check: ``python -m …child FOLDER CHECK STEP FIRST_PROBE``."""

from __future__ import annotations

import json
import os
import pickle
import sys
import traceback
from pathlib import Path

from .bench import Bench, BlockedError, ConcernError, ConformanceError, NotApplicableError
from .checks import CHECKS, LOADING
from .environment import of_log
from .library import MissingError, RefusedError
from .trace import Trace


def main(folder: Path, name: str, step: int, first: int) -> None:
    """Run the step and leave its result in a file. A crash leaves none."""
    try:  # crashes are expected: their core files are useless
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except ImportError:
        pass
    trace = Trace(folder / "trace")
    subject = pickle.loads((folder / "subject").read_bytes())
    check = next(check for check in (LOADING, *CHECKS) if check.name == name)
    bench = Bench(subject, folder, trace, first)
    clause = check.clauses[subject.fmi - 2]
    try:
        state, reason = "passed", check.steps[step](bench)
    except ConformanceError as problem:
        clause = clause if problem.clauses is None else problem.clauses[subject.fmi - 2]
        state, reason = "failed" if clause else "warning", str(problem)
    except RefusedError as problem:
        missing = of_log(problem.said)
        state = "blocked" if missing else "failed" if clause else "warning"
        reason = f"{missing}: {problem}" if missing else str(problem)
    except MissingError as problem:
        state, reason = "failed" if clause else "warning", str(problem)
    except BlockedError as problem:
        state, reason = "blocked", str(problem)
    except ConcernError as problem:
        state, reason = "warning", str(problem)
    except NotApplicableError as problem:
        state, reason = "does not apply", str(problem)
    except OSError as error:  # how ctypes reports a crash on Windows
        state, reason = "failed" if clause else "warning", f"crashed: {error}"
    result = {
        "state": state,
        "reason": reason,
        "clause": clause if state == "failed" else None,
        "resume": bench.resume,
    }
    unfinished = folder / "result.part"
    unfinished.write_text(json.dumps(result))
    unfinished.replace(folder / "result")
    # Whatever the FMU does at the end of the process is not checked.
    os._exit(0)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    try:
        main(folder, sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
    except Exception:  # our own mistake, which must not pass for one of the FMU
        (folder / "broken").write_text(traceback.format_exc())
        os._exit(1)
