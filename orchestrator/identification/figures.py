"""The figure of an identified device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from scipy.stats import exponnorm, norm

from ..data.estimates import Floats
from ..results.figures import drawing
from ..style import ThemeName, use

_WIDE = 6.0
"""Half the width of the figure, in standard deviations."""


def plot_residuals(
    residuals: Mapping[str, Floats],
    std: float,
    share: float,
    mean: float,
    axes: Sequence[Axes] | None = None,
    theme: ThemeName = "light",
) -> Sequence[Axes]:
    """Residuals of the ranges by beacon, and the density that the identified numbers give.

    Parameters
    ----------
    residuals
        Ranges minus what was expected [m], by the name of the beacon.
    std
        Standard deviation that is expected of a punctual range [m].
    share, mean
        Share of late ranges, and their mean excess [m].
    axes
        One for each beacon.
    """
    with use(theme, axes) as look:
        own = axes is None
        axes = drawing.panels(len(residuals), axes, (1.0,) * len(residuals))
        ends = (-_WIDE * std, _WIDE * std + 2 * share * mean)
        x = np.linspace(*ends, 400)
        density = (1 - share) * norm.pdf(x, 0, std) + share * exponnorm.pdf(x, mean / std, 0, std)
        for ax, (beacon, values) in zip(axes, residuals.items(), strict=True):
            beyond = int(np.sum((values < ends[0]) | (values > ends[1])))
            ax.hist(values, bins=60, range=ends, density=True, color=look.receivers[0], alpha=0.5)
            ax.plot(x, density, color=look.ink, lw=1)
            ax.set_xlim(ends)
            told = f"beacon {beacon}" + (f", {beyond} beyond" if beyond else "")
            ax.text(0.99, 0.92, told, transform=ax.transAxes, ha="right", va="top",
                    path_effects=drawing.halo(look))
            ax.set_ylabel("Density [1/m]")
        axes[-1].set_xlabel("Range − expected range [m]")
        drawing.finish(axes, own, "residuals of the ranges by beacon")
    return axes
