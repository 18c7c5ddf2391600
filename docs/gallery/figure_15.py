"""
Figure 15: Pareto chart, Scenario 1
===================================

The Pareto chart of the standardised effects on the total error. The largest are at the top.

The study of Scenario 1: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds. The paper has 50, and so does `sblcosim paper`. Finished runs
are not repeated: the pages of Scenario 1 share their runs.
"""

import sblcosim
from sblcosim.report import paper

folder = "studies/paper-scenario-1"
study = sblcosim.study.load("paper-scenario-1").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_pareto()

# %%
# The factors that the paper names as the most influential, beside our effects:
print(paper.beside(15, sblcosim.analysis.of_study(folder)))

# %%
# To change a level or leave out a factor, change the study. Here the large GPS error is 1 m instead
# of 3.5 m, and the IMU is no factor:
folder = "studies/finer-gps-1"
study.with_levels(gps=[0.1, 1.0]).without("imu").run(folder)
sblcosim.analysis.of_study(folder).plot_pareto()
