"""
Figure 17: main effects, Scenario 1
===================================

The mean error at both levels of each factor.

The study of Scenario 1: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds. The paper has 50, and so does `sblcosim paper`. Finished runs
are not repeated: the pages of Scenario 1 share their runs.
"""

import sblcosim

folder = "studies/paper-scenario-1"
study = sblcosim.study.load("paper-scenario-1").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_main_effects()
