"""
Figure 25: the path of Scenario 3
=================================

The true path in space: straight legs of random lengths and directions. The paper does not say
how it draws its random path.
"""

import sblcosim
from sblcosim.results.figures.run import plot_path_3d

run = sblcosim.run("paper-scenario-3")
plot_path_3d(run.record, {})

# %%
# Another seed draws another path:
other = sblcosim.run("paper-scenario-3", overrides={"seed": 2})
plot_path_3d(other.record, {})
