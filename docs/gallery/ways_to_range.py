"""
Ways to range: error against distance
=====================================

The RMS error of a diver on a circle about a platform with a standalone GPS and a compass of 2°,
for ranging in three ways with arms of 3 m, for a USBL with arms of 2 cm, and for four beacons on
the bottom, 80 m apart. Each point is 40 runs of two minutes.

Far away, the compass decides. Only beacons on the bottom need none. The page *Choose how to range*
has the study, with 200 runs and numbers.
"""

import numpy as np
import sblcosim
from sblcosim.style import new_figure, use

common = {
    "time.sampling_time_s": 1.0, "time.duration_s": 120.0, "target.trajectory": "circle",
    "target.depth_start_m": 5.0, "target.depth_end_m": 5.0, "acoustics.loss_probability": 0.25,
    "acoustics.sound_speed_m_s": 1510.0,
}
clock = {"acoustics.clock_drift_std_s_s": 5e-7, "acoustics.clock_sync_age_s": 1800.0}
two_way = {
    "acoustics.ranging": "two_way", "acoustics.turnaround_s": 0.05,
    "acoustics.turnaround_std_s": 5e-5, "acoustics.turnaround_bias_std_s": 1e-4,
}
inverted = clock | {"acoustics.ranging": "inverted"}
usbl = inverted | {
    "acoustics.range_std_m": 0.001, "acoustics.range_common_std_m": 0.1,
    "acoustics.arrivals_shared": True, "platform.arm_length_m": 0.02,
    "platform.misalignment_heading_std_deg": 0.5, "platform.misalignment_tilt_std_deg": 0.5,
}
families = {
    "one-way": ("platform", "coupled", clock),
    "two-way": ("platform", "coupled", two_way),
    "inverted": ("platform", "coupled", inverted),
    "USBL": ("platform", "array", usbl),
    "beacons on the bottom": ("bottom", "long_baseline", clock),
}
bottom = {"beacon_m": [[40, 40, 25], [-40, 40, 25], [-40, -40, 25], [40, -40, 25]],
          "mounting_std_m": 0.3}
boat = {"beaufort": 2, "gps_grade": "standalone", "arm_length_m": 3.0,
        "imu_tilt_std_deg": 1.0}
distances = np.array([10.0, 30.0, 100.0, 300.0])


def errors(place, receiver, keys, compass):
    """RMS total error at each distance [m]."""
    scenario = sblcosim.load({
        "name": "round",
        "platform": boat | {"imu_heading_turn_on_std_deg": compass}
        if place == "platform" else bottom,
        "receiver": {"type": receiver, "acceleration_psd_m2_s3": "learned"},
    })
    found = []
    for distance in distances:
        changed = common | keys | {"target.radius_m": float(distance)}
        runs = sblcosim.run_many(scenario, receiver, changed, runs=40).runs.table
        found.append(np.sqrt((runs[f"{receiver}.absolute_total_rms_m"] ** 2).mean()))
    return found


def plot_ways(compass=2.0):
    """RMS error of each family against the distance, for a compass [degrees]."""
    with use("light") as look:
        ax = new_figure(7.0, 4.2).subplots()
        for (name, it), mark, line in zip(families.items(), "os^Dv", look.receivers, strict=False):
            ax.loglog(distances, errors(*it, compass), marker=mark, label=name, color=line)
        ax.set(xlabel="Distance from the platform [m]", ylabel="RMS error [m]")
        ax.set_xticks(distances, [f"{it:g}" for it in distances])
        ax.set_yticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
        ax.minorticks_off()
        ax.legend()
    return ax


plot_ways()

# %%
# To see what a better compass does, change its error:
plot_ways(compass=0.5)
