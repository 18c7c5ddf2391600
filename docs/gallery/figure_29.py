"""
Figure 29: interactions, Scenario 3
===================================

The mean error at each pair of levels. Lines that are not parallel show an interaction.

The study of Scenario 3: seven factors at two levels, all 128 combinations. Here each has 10 runs,
so that the page is made in seconds. The paper has 50, and so does `sblcosim paper`. Finished runs
are not repeated: the pages of Scenario 3 share their runs.
"""

import sblcosim
from sblcosim.report import paper

folder = "studies/paper-scenario-3"
study = sblcosim.study.load("paper-scenario-3").with_replicates(10)
study.run(folder)
sblcosim.analysis.of_study(folder).plot_interactions()

# %%
# The paper says that the GPS interacts with the other parameters. Our interactions with it:
print(paper.beside(29, sblcosim.analysis.of_study(folder)))

# %%
# To change a level or leave out a factor, change the study. Here the large GPS error is 1 m instead
# of 3.5 m, and the IMU is no factor:
folder = "studies/finer-gps-3"
study.with_levels(gps=[0.1, 1.0]).without("imu").run(folder)
sblcosim.analysis.of_study(folder).plot_interactions()
