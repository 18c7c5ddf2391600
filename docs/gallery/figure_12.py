"""
Figure 12: the path of Scenario 1
=================================

The true path, a semicircle, from above and in space. Its radius of 15 m is the paper's. The
paper does not give its centre or its first point.
"""

import sblcosim
from sblcosim.report import paper
from sblcosim.results.figures.run import plot_path, plot_path_3d

run = sblcosim.run("paper-scenario-1")
plot_path(run.record, {})

# %%
# In space:
plot_path_3d(run.record, {})

# %%
# The radius that the paper states, beside ours:
print(paper.beside(12))

# %%
# To swim farther out, change the radius:
wide = sblcosim.run("paper-scenario-1", overrides={"target.radius_m": 30.0})
plot_path(wide.record, {})
