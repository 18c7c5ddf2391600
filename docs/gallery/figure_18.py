"""
Figure 18: residuals, Scenario 1
================================

The residuals of the model: a normal probability plot, a histogram, and plots against the fitted
values and the order of the runs.

The study of Scenario 1: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds. The paper has 50, and so does `sblcosim paper`. Finished runs
are not repeated: the pages of Scenario 1 share their runs.
"""

import sblcosim

folder = "studies/paper-scenario-1"
study = sblcosim.study.load("paper-scenario-1").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_residuals()

# %%
# To change a level or leave out a factor, change the study. Here the large GPS error is 1 m instead
# of 3.5 m, and the IMU is no factor:
folder = "studies/finer-gps-1"
study.with_levels(gps=[0.1, 1.0]).without("imu").run(folder)
sblcosim.analysis.of_study(folder).plot_residuals()
