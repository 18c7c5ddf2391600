"""
Figure 9: the platform in waves
===============================

Roll, pitch and yaw of the platform in seas of two heights, 0.2 m (Beaufort 2) and 1.0 m
(Beaufort 4). The paper prints no angles, nor the amplitudes, frequencies and phases of its
waves. Ours follow from the wave height.
"""

import sblcosim
from sblcosim.report import paper

slight = {"platform.beaufort": 2, "time.duration_s": 60.0}
sblcosim.run("harbour-square", overrides=slight).plot_inclination()

# %%
# And at Beaufort 4:
moderate = {"platform.beaufort": 4, "time.duration_s": 60.0}
sblcosim.run("harbour-square", overrides=moderate).plot_inclination()

# %%
# The settings that the paper states, beside ours:
print(paper.beside(9))

# %%
# The paper's waves are one sine per axis, with phases of their own. A sea has many waves, and roll,
# pitch and heave share them. The same sea with a spectrum, long waves from between ahead and abeam:
sea = {"platform.motion": "spectrum", "platform.wave_direction_deg": 225.0}
spread = {"platform.wave_spreading_deg": 25.0}
sblcosim.run("harbour-square", overrides=moderate | sea | spread).plot_inclination()

# %%
# To see another sea, change the Beaufort number:
rough = slight | {"platform.beaufort": 6}
sblcosim.run("harbour-square", overrides=rough).plot_inclination()
