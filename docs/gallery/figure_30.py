"""
Figure 30: main effects, Scenario 3
===================================

The mean error at both levels of each factor.

The study of Scenario 3: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds. The paper has 50, and so does `sblcosim paper`. Finished runs
are not repeated: the pages of Scenario 3 share their runs.
"""

import sblcosim

folder = "studies/paper-scenario-3"
study = sblcosim.study.load("paper-scenario-3").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_main_effects()
