"""
Figure 20: true path and estimate, Scenario 2
=============================================

The coordinates over time along a spiral: true, and as the paper's filter estimates them.

Only one point of the design is near Tables 4 to 6 of the paper: small errors of GPS and range, long
arms, and a ping every 0.1 s. These keys change the shipped scenario to this point.
"""

import sblcosim

point = {
    "target.speed_m_s": 0.3,
    "target.depth_std_m": 0.1,
    "platform.imu_tilt_std_deg": 10.0,
    "platform.imu_heading_std_deg": 10.0,
    "receiver.acceleration_psd_m2_s3": 0.1,
}
run = sblcosim.run("paper-scenario-2", overrides=point)
run.plot_axes()

# %%
# To change a level, change its key. Here the GPS error has the high level of Table 3, 3.5 m:
coarse = point | {"platform.gps_horizontal_std_m": 3.5}
sblcosim.run("paper-scenario-2", overrides=coarse).plot_axes()
