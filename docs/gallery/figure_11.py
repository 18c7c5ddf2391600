"""
Figure 11: a session in the harbour
===================================

A square 2 m below the surface, seen from above: the true path, the paper's filter and the raw fix.
The paper states depth, packet loss (half of all) and speed of sound. The other settings of
`harbour-square` were chosen to come near its Table 2.
"""

import sblcosim
from sblcosim.report import paper

session = sblcosim.run("harbour-square")
session.plot_path()

# %%
# The settings that the paper states, beside ours:
print(paper.beside(11))

# %%
# The square in the paper's Table 2, beside 100 such sessions. Sessions differ, because the GPS
# error varies slowly.
runs = sblcosim.run_many("harbour-square", ["ekf", "multilateration"], runs=100).tables["runs"]
print(paper.beside(11, runs))

# %%
# To change the slow GPS error, change its key. Here it is 0.3 m instead of 1.05 m:
finer = {"platform.gps_horizontal_markov_std_m": 0.3}
sblcosim.run("harbour-square", overrides=finer).plot_path()
