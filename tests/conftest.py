"""Makes the helpers beside the tests importable (``from stepper import Stepper``)."""

import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import pytest

for folder in ("fmus", "models"):
    sys.path.insert(0, str(Path(__file__).parent / "unit" / folder))


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Build all components before the workers of a whole run begin, so that not each does it."""
    option = session.config.option
    is_worker = hasattr(session.config, "workerinput")
    if is_worker or not getattr(option, "numprocesses", None) or option.file_or_dir:
        return
    from sblcosim.fmus.build.factory import build
    from sblcosim.fmus.errors import BuildError
    from sblcosim.models import COMPONENTS

    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for fmi in (2, 3):  # the engines of the first are those of the second
            done = [pool.submit(build, name, fmi) for name in reversed(COMPONENTS)]
            for each in done:
                with suppress(BuildError):  # the tests say so
                    each.result()
