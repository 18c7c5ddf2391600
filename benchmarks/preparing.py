"""Cost of a study before its first step: this build and another, in alternation.

Prints processor time per point of the paper's studies for both, and an interval for the ratio (see
`alternating.py`). Processor time still depends on other work of the machine; the ratio much less.
Run by hand: ``python benchmarks/preparing.py OTHER_PYTHON [--rounds 7]``, where OTHER_PYTHON
belongs to an environment with the other build.

Compared with the build before points shared anything, on two cores shared with other work:

================  ==============  =============  =================
study             before [ms]     now [ms]       ratio
================  ==============  =============  =================
paper-scenario-1  2.8             0.36           0.12 (0.12-0.16)
ranges-1          4.2             0.52           0.12 (five pairs)
================  ==============  =============  =================

All simulations of ``sblcosim paper``, in one thread: 50.1 to 58.4 and 12.0 to 12.4 s of processor
time (0.21 to 0.24, three pairs beside other work). About a third is before the first step, and most
of the rest is in the steps themselves.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
from functools import partial

from alternating import alternated, ratio

STUDIES = ("paper-scenario-1", "ranges-1")
CODE = """
import sys, time, warnings
from sblcosim.report.paper.campaigns import all_campaigns
from sblcosim.study.campaign import prepare
warnings.simplefilter("ignore")
study = all_campaigns(quick=True)[sys.argv[1]]
prepare(study)
times = []
for _ in range(3):
    start = time.process_time()
    prepare(study)
    times.append(time.process_time() - start)
print(min(times) / len(study.points.values) * 1e3)
"""


def measured(python: str, study: str) -> float:
    """Milliseconds per point of a study."""
    command = [python, "-c", CODE, study]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stdout)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("other")
    arguments.add_argument("--rounds", type=int, default=7)
    given = arguments.parse_args()
    for study in STUDIES:
        builds = [partial(measured, python, study) for python in (given.other, sys.executable)]
        times = alternated(*builds, given.rounds)
        before, now = map(statistics.median, times)
        print(f"{study}: {before:.2f} ms and {now:.2f} ms a point, ratio {ratio(*times)}")


if __name__ == "__main__":
    main()
