"""
Figure 19: the path of Scenario 2
=================================

The true path, a spiral, from above and in space. Its radius, turns and
length are not given by the paper.
"""

import sblcosim
from sblcosim.results.figures.run import plot_path, plot_path_3d

run = sblcosim.run("paper-scenario-2")
plot_path(run.record, {})

# %%
# In space:
plot_path_3d(run.record, {})
