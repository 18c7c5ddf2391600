"""A command's finished runs are kept until it continues, or until its result is written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import SblcosimError
from . import outcome

if TYPE_CHECKING:
    from ...study.kept import Kept


@contextmanager
def keeping(result: Path) -> Iterator[Kept]:
    """Keep finished runs beside the folder of a result until the end of the block."""
    from ...study.kept import Kept

    kept = Kept(result)
    try:
        yield kept
    except KeyboardInterrupt as stop:
        runs = kept.runs
        if not runs:
            kept.remove()
        outcome.kept(stop, str(runs), kept.folder)
    except SblcosimError as error:
        if runs := kept.runs:
            error.args = (f"{error}; {runs} finished runs are kept in {kept.folder}",)
        else:
            kept.remove()
        raise
    kept.remove()
