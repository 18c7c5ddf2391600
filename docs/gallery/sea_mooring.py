"""
The sea: drift of a mooring
===========================

Half an hour of a moored platform in a watch circle of 3 m, which holds it for 95 % of the time, and
its distance from the middle. The mooring pulls it back in 30 s.
"""

import numpy as np
import sblcosim
from sblcosim.style import new_figure, use


def plot_drift(circle_m, time_s):
    """The track of the platform, and its distance from the middle of its watch circle."""
    moored = {
        "motion": "spectrum", "wave_height_m": 0.0, "watch_circle_m": circle_m,
        "mooring_time_s": time_s,
    }
    scenario = {"time": {"duration_s": 1800.0}, "platform": moored}
    record = sblcosim.run(scenario, "multilateration").record
    north, east, _ = record.values["platform.position"].T
    with use("light") as look:
        track, distance = new_figure(8.0, 3.6).subplots(1, 2, width_ratios=(2, 3))
        around = np.linspace(0, 2 * np.pi, 200)
        track.plot(circle_m * np.sin(around), circle_m * np.cos(around), "--", color=look.ink)
        track.plot(east, north, color=look.receivers[1], lw=0.8)
        track.set(xlabel="East [m]", ylabel="North [m]", aspect="equal")
        off = np.hypot(north, east)
        distance.axhline(circle_m, ls="--", color=look.ink, label="watch circle")
        distance.plot(record.time_ns / 60e9, off, color=look.receivers[1], lw=0.8)
        inside = 100 * np.mean(off <= circle_m)
        distance.set(xlabel="Time [min]", ylabel="Distance [m]",
                     title=f"within the circle for {inside:.0f} % of this half hour")
        distance.set_ylim(0, 1.25 * circle_m)
        distance.legend(loc="upper right")
    return distance


plot_drift(circle_m=3.0, time_s=30.0)

# %%
# A longer line gives way for longer. To see another mooring, change its circle and its time:
plot_drift(circle_m=6.0, time_s=120.0)
