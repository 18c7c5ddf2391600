"""Draw the README's picture again: ``python docs/draw.py``."""

from pathlib import Path

import sblcosim
from matplotlib.figure import Figure

result = sblcosim.run("harbour-square", receiver=["ekf", "sequential"])
for theme, name in (("light", "harbour-square.png"), ("dark", "harbour-square-dark.png")):
    figure = result.plot_path(theme=theme).figure
    assert isinstance(figure, Figure)
    figure.savefig(Path(__file__).with_name(name), dpi=110)
