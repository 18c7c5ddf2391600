"""What a study costs before its first step: this build and another, in alternation.

Prints processor time per point of the paper's studies for both, and an interval of the ratio: the
median over the rounds with its 95 % bootstrap interval. Processor time still depends on what else
the machine does; the ratio much less. Run by hand:
``python benchmarks/preparing.py OTHER_PYTHON [--rounds 7]``, where OTHER_PYTHON is that of an
environment with the other build.

Against the build before points shared anything, on two cores that were shared with other work:

================  ==============  =============  =================
study             before [ms]     now [ms]       ratio
================  ==============  =============  =================
paper-scenario-1  3.3             0.51           0.15 (0.13-0.17)
ranges-1          4.5             0.61           0.14 (0.13-0.15)
================  ==============  =============  =================

All simulations of ``sblcosim paper``, in one thread: 42.9 and 13.5 s of processor time, of which
34.0 and 5.5 s go before the first step, and most of the rest into the steps themselves.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

import numpy as np

STUDIES = ("paper-scenario-1", "ranges-1")
CODE = """
import sys, time, warnings
from sblcosim.report.paper.campaigns import all_campaigns
from sblcosim.study.campaign import prepare
warnings.simplefilter("ignore")
made = all_campaigns(quick=True)
for name in sys.argv[1:]:
    prepare(made[name])
    times = []
    for _ in range(3):
        start = time.process_time()
        prepare(made[name])
        times.append(time.process_time() - start)
    print(min(times) / len(made[name].points.values) * 1e3)
"""


def measured(python: str) -> list[float]:
    """Milliseconds per point of each study."""
    command = [python, "-c", CODE, *STUDIES]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [float(line) for line in done.stdout.split()]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("other")
    arguments.add_argument("--rounds", type=int, default=7)
    given = arguments.parse_args()
    pairs = np.array([
        (measured(given.other), measured(sys.executable)) for _ in range(given.rounds)
    ])  # fmt: skip
    ratios = pairs[:, 1] / pairs[:, 0]
    rng = np.random.default_rng(1)
    rows = rng.integers(0, len(ratios), (2000, len(ratios)))
    low, high = np.quantile(np.median(ratios[rows], axis=1), (0.025, 0.975), axis=0)
    for i, name in enumerate(STUDIES):
        before, now = np.median(pairs[:, :, i], axis=0)
        print(f"{name}: {before:.2f} ms and {now:.2f} ms a point, ratio "
              f"{np.median(ratios[:, i]):.3f} ({low[i]:.3f}-{high[i]:.3f})")


if __name__ == "__main__":
    main()
