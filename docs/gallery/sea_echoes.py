"""
The sound: a map of echoes
==========================

Share of the ranges that come by an echo, and their mean excess, for divers 2 m deep in 3.5 m of
water. Four beacons are on arms of 3 m, 0.5 m deep. A fifth of the direct paths is lost. The echo
from the surface then arrives with a probability of 0.3, that from the bottom with 0.2.

All divers swim north. Their bodies take most of what comes from behind: echoes are frequent there.
The excess is large near the beacons, where paths by the bottom are steep.
"""

import numpy as np
import sblcosim
from sblcosim.limits import echoes, places
from sblcosim.style import new_figure, use

keys = {
    "loss_probability": 0.2, "surface_echo_probability": 0.3, "bottom_echo_probability": 0.2,
    "water_depth_m": 3.5, "shadow_loss_probability": 0.8,
}


def plot_echoes(**changes):
    """Share and mean excess of echoes over an area of 60 m by 60 m."""
    told = {f"acoustics.{key}": value for key, value in (keys | changes).items()}
    scenario = sblcosim.load("harbour-square", told)
    a, side = scenario.acoustics, np.linspace(-30, 30, 81)
    east, north = np.meshgrid(side, side)
    divers = np.stack([north, east, np.full_like(north, 2.0)], -1)[..., None, :]
    beacons, course = places.still_beacons(scenario), np.array([1.0, 0.0, 0.0])
    direct = (1 - a.loss_probability) * (1 - echoes.shades(a, divers, beacons, course))
    excess = np.sort(echoes.excesses(a, divers, beacons), axis=-1)
    surface, bottom = echoes.echo_chances(a)  # the surface is nearer to divers and beacons
    first, second = (1 - direct) * surface, (1 - direct) * (1 - surface) * bottom
    late = (first + second).sum(-1)
    share = 100 * late / (late + direct.sum(-1))
    mean = (first * excess[..., 0] + second * excess[..., 1]).sum(-1) / late
    with use("light") as look:
        axes = new_figure(8.0, 3.9).subplots(1, 2, sharey=True)
        for ax, values, words in zip(
            axes, (share, mean), ("Share [%]", "Mean excess [m]"), strict=True
        ):
            filled = ax.contourf(east, north, values, 10, cmap="cividis")
            ax.figure.colorbar(filled, ax=ax, label=words, shrink=0.75)
            ax.plot(beacons[:, 1], beacons[:, 0], "^", color=look.receivers[0])
            ax.set(xlabel="East [m]", aspect="equal")
            ax.grid(visible=False)
        axes[0].set_ylabel("North [m]")
    return axes[0]


plot_echoes()

# %%
# To see another place, change the depth of the water and the width of the shadow:
plot_echoes(water_depth_m=10.0, shadow_half_width_deg=80.0)
