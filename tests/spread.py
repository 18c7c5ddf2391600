"""Which tests of a whole run one worker must run."""

from __future__ import annotations

from xdist.scheduler import LoadFileScheduling

ONE_BY_ONE = (
    "tests/acceptance/test_documents.py",
    "tests/acceptance/test_kills.py",
    "tests/acceptance/test_own_receivers.py",
    "tests/acceptance/test_recipes.py",
    "tests/fmu/test_calls.py",
    "tests/robustness/test_command_line.py",
    "tests/robustness/test_mutated_inputs.py",
    "tests/unit/orchestrator/test_layout.py",
)
"""Long files whose tests share nothing, so that any worker may run any of them."""


class Spread(LoadFileScheduling):  # type: ignore[misc]
    """The tests of a file stay together, but for those above.

    xdist begins with the files of most tests. Single ones come last: so a run ends with many short
    pieces instead of a long file.
    """

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return nodeid if file in ONE_BY_ONE else file
