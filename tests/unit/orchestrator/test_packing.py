"""The user's code as bytes: it keeps the name of its file, whatever cloudpickle does with it."""

from __future__ import annotations

from types import CodeType

import cloudpickle
import pytest
from sblcosim.simulation.code import user_code
from sblcosim.simulation.code.packing import packed


def outer(sign: float) -> object:
    class Inner:
        def method(self) -> float:
            return sign

    return Inner


@pytest.mark.parametrize("forgotten", [False, True], ids=["as installed", "as in 3.1.3"])
@pytest.mark.parametrize("pack", [packed, user_code.by_value])
def test_code_that_was_sent_names_its_file(
    forgotten: bool, pack: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = cloudpickle.Pickler.dispatch_table
    reduce = table[CodeType]
    if forgotten:
        monkeypatch.setitem(
            table, CodeType, lambda code: reduce(code.replace(co_filename="<dynamic-code>"))
        )
    found = cloudpickle.loads(pack(outer(-1.0)))
    assert found().method() == -1.0
    assert found.method.__code__.co_filename == __file__
    assert found.method.__code__.co_firstlineno == outer(0.0).method.__code__.co_firstlineno
