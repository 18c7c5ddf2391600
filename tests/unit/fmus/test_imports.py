"""What an FMU is made from, as its sources' import statements say."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
import sblcosim.fmus
import sblcosim.models
from sblcosim.fmus.build.ingredients import _statements

SOURCES = [
    file for package in (sblcosim.fmus, sblcosim.models)
    for file in Path(package.__path__[0]).rglob("*.py")
]  # fmt: skip


def imports(nodes: object) -> set[int]:
    return {n.lineno for n in nodes if isinstance(n, ast.Import | ast.ImportFrom)}  # type: ignore[attr-defined]


def test_imports_are_found_in_all_our_sources() -> None:
    assert len(SOURCES) > 50
    for file in SOURCES:
        tree = ast.parse(file.read_text("utf-8"))
        assert imports(_statements(tree)) == imports(ast.walk(tree)), file


@pytest.mark.parametrize(
    "where",
    ["{}", "def f():\n {}", "class C:\n {}", "if a: {}", "if a: pass\nelse: {}", "for x in y: {}",
     "while a: pass\nelse: {}", "with a: {}", "try: {}\nfinally: pass",
     "try: pass\nexcept A: {}", "try: pass\nexcept A: pass\nelse: {}", "try: pass\nfinally: {}",
     "async def f():\n async with a: {}", "match a:\n case 1: {}", "try: pass\nexcept* A: {}",
     "if a:\n def f():\n  try: pass\n  finally: {}"],
)  # fmt: skip
def test_an_import_is_found_wherever_it_stands(where: str) -> None:
    tree = ast.parse(where.format("import os"))
    assert imports(_statements(tree)) == imports(ast.walk(tree)) != set()
