"""Makes the helpers beside the tests importable (``from stepper import Stepper``)."""

import sys
from pathlib import Path

for folder in ("fmus", "models"):
    sys.path.insert(0, str(Path(__file__).parent / "unit" / folder))
