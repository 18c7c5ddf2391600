"""
The sea: sines and a spectrum
=============================

Roll, and the track of the platform's reference point seen from above, in the paper's waves and in a
sea with a spectrum. Both have waves of 0.6 m (Beaufort 3), and the raft is 1.6 m long.

With sines, roll repeats every 3.9 s, and nothing moves the raft sideways. With a spectrum, waves
come in groups, roll and pitch share them, and the raft goes to and fro with each wave, here mostly
from the west-southwest.
"""

import numpy as np
import sblcosim
from sblcosim.style import new_figure, use

sines = {"beaufort": 3}
spectrum = {
    "beaufort": 3, "motion": "spectrum", "wave_direction_deg": 60.0, "wave_spreading_deg": 25.0,
}


def plot_motion(**platforms):
    """Roll over time, and the track of the reference point."""
    with use("light") as look:
        roll, track = new_figure(8.0, 3.4).subplots(1, 2, width_ratios=(3, 2))
        for (name, keys), colour, style in zip(
            platforms.items(), look.receivers[:2], ("-", "--"), strict=True
        ):
            scenario = {"time": {"duration_s": 60.0}, "platform": keys}
            record = sblcosim.run(scenario, "multilateration").record
            time, shown = record.time_ns / 1e9, record.time_ns <= record.time_ns[0] + 40e9
            tilt = np.rad2deg(record.values["platform.attitude"][:, 0])
            north, east, _ = record.values["platform.position"].T
            roll.plot(time[shown], tilt[shown], style, color=colour, label=name)
            track.plot(east, north, style, color=colour, lw=0.8)
            track.plot(east[0], north[0], "o", color=colour, ms=4)
        roll.set(xlabel="Time [s]", ylabel="Roll [°]")
        roll.legend(loc="upper right", ncols=len(platforms))
        roll.set_ylim(top=1.5 * roll.get_ylim()[1])
        track.set(xlabel="East [m]", ylabel="North [m]", aspect="equal")
    return roll


plot_motion(sines=sines, spectrum=spectrum)

# %%
# A boat of 6 m averages short waves out. To see another one, change its size:
boat = spectrum | {"raft_size_m": 6.0, "raft_draught_m": 0.5}
plot_motion(raft=spectrum, boat=boat)
