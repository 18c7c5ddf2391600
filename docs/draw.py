"""Draw the README's picture again: ``python docs/draw.py``."""

from pathlib import Path

import sblcosim
from matplotlib.figure import Figure

result = sblcosim.run("realistic-dive", receiver=["coupled", "ekf"])
for theme, name in (("light", "realistic-dive.png"), ("dark", "realistic-dive-dark.png")):
    figure = result.plot_path(theme=theme).figure
    assert isinstance(figure, Figure)
    figure.savefig(Path(__file__).with_name(name), dpi=110)
