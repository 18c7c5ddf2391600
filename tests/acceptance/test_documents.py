"""What the documents promise is there, and their code runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sblcosim.study.study import load

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    ROOT / "README.md", ROOT / "ARCHITECTURE.md", *sorted(ROOT.glob("models/*/README.md")),
    *sorted(ROOT.glob("orchestrator/*/README.md")),
]


def test_every_model_folder_has_a_readme() -> None:
    folders = [f.parent for f in sorted(ROOT.glob("models/*/variables.py"))]
    assert len(folders) == 5
    assert all((folder / "README.md").is_file() for folder in folders)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_that_a_document_names_exist(path: Path) -> None:
    text = path.read_text()
    links = re.findall(r'(?:src|srcset)="([^"]+)"|\]\(([^)#:]+)\)', text)
    folders = "tests|tools|benchmarks|examples|models|fmus|orchestrator|docs"
    named = re.findall(rf"`((?:{folders})/[\w/.-]+\.\w+)`", text)
    for name in [*(a or b for a, b in links), *named]:
        assert (path.parent / name).exists() or (ROOT / name).exists(), name


def python_blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)


@pytest.mark.parametrize("number", range(len(python_blocks())))
def test_code_in_the_readme_runs(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code = python_blocks()[number]
    if "fmus/fmi2" in code:
        from sblcosim.fmus.build.factory import build

        folder = tmp_path / "fmus" / "fmi2"
        folder.mkdir(parents=True)
        (folder / "target.fmu").write_bytes(build("target", 2).read_bytes())
    exec(compile(code, f"README block {number}", "exec"), {"__name__": "__main__"})


def test_the_study_of_the_readme_can_be_run(tmp_path: Path) -> None:
    readme = (ROOT / "README.md").read_text()
    text = readme.partition("<!-- study -->\n```toml\n")[2].partition("```")[0]
    (tmp_path / "my-study.toml").write_text(text)
    study = load(tmp_path / "my-study.toml")
    assert len(study.points.values) == 8
    for design in (
        {"kind": "fraction", "generators": ["C=AB"]},
        {"kind": "fraction", "resolution": 3},
        {"kind": "full", "centre_points": 5},
    ):
        tables = study.model_dump(exclude_unset=True) | {"design": design}
        assert len(load(tables).points.values) in (4, 13)
