"""
Figure 22: Pareto chart, Scenario 2
===================================

Which effects on the total error are the largest: the Pareto chart of the standardised effects.

The study of Scenario 2: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds; the paper has 50, and so has `sblcosim paper`. What is there
already is not run again: the pages of Scenario 2 share their runs.
"""

import sblcosim

folder = "studies/paper-scenario-2"
study = sblcosim.study.load("paper-scenario-2").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_pareto()
