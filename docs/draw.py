"""Draw the README's picture again: ``python docs/draw.py``."""

from pathlib import Path

import sblcosim
from matplotlib.figure import Figure

result = sblcosim.run("paper-scenario-1")
for theme, name in (("light", "scenario-1.png"), ("dark", "scenario-1-dark.png")):
    figure = result.plot_path(theme=theme).figure
    assert isinstance(figure, Figure)
    figure.savefig(Path(__file__).with_name(name), dpi=110)
