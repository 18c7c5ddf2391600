"""
Figure 18: residuals, Scenario 1
================================

The residuals of the model: normal probability, histogram, against the fitted values, and in the
order of the runs.

The study of Scenario 1: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds; the paper has 50, and so has `sblcosim paper`. What is there
already is not run again: the pages of Scenario 1 share their runs.
"""

import sblcosim

folder = "studies/paper-scenario-1"
study = sblcosim.study.load("paper-scenario-1").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_residuals()
