"""What stands in for things of the product goes through one seam, and leaves nothing behind."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import seams
from sblcosim import api
from sblcosim.fmus import files
from sblcosim.scenario.scenario import Scenario
from sblcosim.study import runner
from seams import Seam, program
from spread import ONE_BY_ONE

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
FILES = sorted(TESTS.rglob("*.py"))


def test_whoever_has_imported_a_function_finds_what_stands_in_for_it() -> None:
    thing = files.write_file
    others = [m for m in (*sys.modules.values(),) if _has(m, thing)]
    assert len(others) > 1

    def stand_in() -> None:
        raise AssertionError

    with Seam() as seam:
        seam.instead(files.write_file, stand_in)
        assert not any(_has(m, thing) for m in others)
        assert all(_has(m, stand_in) for m in others)
    assert all(_has(m, thing) for m in others)
    with Seam() as seam:
        seam.instead(files.write_file, stand_in, only=others[0])
        assert [m for m in others if _has(m, stand_in)] == others[:1]


def test_a_module_that_is_loaded_in_the_meantime_keeps_no_stand_in(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    late = ModuleType("sblcosim.late")
    thing = api.run
    with Seam() as seam:
        seam.instead(api.run, print)
        monkeypatch.setitem(sys.modules, late.__name__, late)
        late.run = api.run  # type: ignore[attr-defined]
        late.own = None  # type: ignore[attr-defined]
        assert late.run is print
    assert late.run is api.run is thing
    assert late.own is None


def test_methods_and_several_stand_ins_are_put_back() -> None:
    kept, run = Scenario.override, api.run
    with Seam() as seam:
        seam.instead(Scenario.override, lambda *_: None)
        for _ in range(2):
            seam.instead(api.run, lambda: None)
        assert Scenario.override is not kept
    assert (Scenario.override, api.run) == (kept, run)


def test_a_module_forgets_what_it_has_remembered_and_keeps_what_it_knows(tmp_path: Path) -> None:
    files.write_file(tmp_path / "first", b"")
    swept: list[Path] = []
    with Seam() as seam:
        seam.instead(files.sweep, swept.append)
        files.write_file(tmp_path / "second", b"")
        assert swept == []  # once in a process
        seam.forgets(files)
        files.write_file(tmp_path / "third", b"")
        assert swept == [tmp_path]
    with Seam() as seam:
        seam.instead(files.sweep, swept.append)
        files.write_file(tmp_path / "fourth", b"")
        assert swept == [tmp_path] * 2  # what was remembered in the block is gone, too


def test_what_the_product_does_not_have_is_refused() -> None:
    with Seam() as seam, pytest.raises(AssertionError, match="nobody in sblcosim has"):
        seam.instead(_has, print)
    with Seam() as seam, pytest.raises(AssertionError, match="use `tuned`"):
        seam.instead(runner.BATCH, 2)


def test_numbers_are_tuned_in_this_process_and_in_others() -> None:
    before = runner.BATCH
    with Seam() as seam:
        seam.tuned(batch=before + 1)
        assert before + 1 == runner.BATCH
    assert before == runner.BATCH
    names = {"sys": sys}
    with Seam() as seam:
        seam.tuned(batch=before)  # puts back what the text changes
        text = program(batch=before + 2)
        assert text.endswith("\ncli.main()")
        exec(text.removesuffix("cli.main()"), names)
        assert before + 2 == runner.BATCH


def test_every_number_of_the_table_is_there_and_used() -> None:
    text = "\n".join(path.read_text("utf-8") for path in FILES if path.name != "seams.py")
    for known_as, (module, name) in seams.numbers().items():
        assert isinstance(getattr(module, name), int | float)
        assert f"{known_as}=" in text or f'"{known_as}"' in text, known_as


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(TESTS).as_posix())
def test_modules_of_the_product_are_changed_through_the_seam(path: Path) -> None:
    tree = ast.parse(path.read_text("utf-8"))
    assert [*_around(tree)] == []


@pytest.mark.parametrize("line", [
    "monkeypatch.setattr('sblcosim.api.run', f)",
    "import sblcosim.api\npatch.setattr(sblcosim.api, 'run', f)",
    "from sblcosim import api as its\nmonkeypatch.setattr(its, 'run', f)",
    "from sblcosim.study import runner\nmonkeypatch.setattr(runner.time, 'perf_counter', f)",
    "def test():\n    from sblcosim.study import runner\n    runner.BATCH = 3",
    "mock.patch('sblcosim.api.run')",
])  # fmt: skip
def test_what_goes_round_the_seam_is_found(line: str) -> None:
    assert [*_around(ast.parse(line))]


def test_files_whose_tests_any_worker_may_run_share_nothing() -> None:
    for name in ONE_BY_ONE:
        text = (ROOT / name).read_text("utf-8")
        assert 'scope="module"' not in text, name


def _has(module: ModuleType, thing: object) -> bool:
    ours = module.__name__.partition(".")[0] == "sblcosim"
    return ours and any(value is thing for value in vars(module).values())


def _around(tree: ast.AST) -> Iterator[str]:
    """Where something of the product is replaced by the name of a module."""
    modules = {
        alias.asname or alias.name
        for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
        for alias in node.names if _is_module(f"{node.module}.{alias.name}")
    }  # fmt: skip

    def of_the_product(target: ast.expr) -> bool:
        if isinstance(target, ast.Constant):
            return str(target.value).startswith("sblcosim")
        first = ast.unparse(target).partition(".")[0]
        return first == "sblcosim" or (
            first in modules and not ast.unparse(target).rpartition(".")[2].istitle()
        )

    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Attribute(attr="setattr" | "patch"), args=[target, *_]):
                if of_the_product(target):
                    yield ast.unparse(node)
            case ast.Assign(targets=[ast.Attribute(value=target)]):
                if of_the_product(target):
                    yield ast.unparse(node)


def _is_module(dotted: str) -> bool:
    package, *rest = dotted.split(".")
    folder = ROOT if rest[:1] in (["fmus"], ["models"]) else ROOT / "orchestrator"
    place = folder.joinpath(*rest)
    return package == "sblcosim" and (place.is_dir() or place.with_suffix(".py").is_file())
