"""
Figure 19: the path of Scenario 2
=================================

The true path, a spiral, from above and in space. The paper does not give its
radius, turns and length.
"""

import sblcosim
from sblcosim.results.figures.run import plot_path, plot_path_3d

run = sblcosim.run("paper-scenario-2")
plot_path(run.record, {})

# %%
# In space:
plot_path_3d(run.record, {})

# %%
# To change the spiral, change its keys. Here it has four turns instead of two:
tight = sblcosim.run("paper-scenario-2", overrides={"target.turns": 4.0})
plot_path(tight.record, {})
