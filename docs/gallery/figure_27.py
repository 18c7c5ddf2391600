"""
Figure 27: errors, Scenario 3
=============================

The filter's errors along x, y and z, and in total, with twice the standard deviation that it
claims.

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
run = sblcosim.run("paper-scenario-3", overrides=point)
run.plot_errors()
