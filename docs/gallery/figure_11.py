"""
Figure 11: a session in the harbour
===================================

A square 2 m below the surface, seen from above: the true path, the paper's filter and the raw fix.
The paper states depth, packet loss (half of all) and speed of sound; the other settings of
`harbour-square` were chosen to come near its Table 2.
"""

import sblcosim

session = sblcosim.run("harbour-square")
session.plot_path()
