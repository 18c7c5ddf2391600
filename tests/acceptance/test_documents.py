"""What the documents promise is there, and their code runs.

The first word after a fence is the language; what follows says what is done with the block:

- ``python``, ``sh``: run, in the order of the page, in one folder; ``python FILE``: saved first;
- ``sh warns``: run, with warnings, which the page explains;
- ``toml FILE``: saved, for the blocks below; ``toml``: read;
- ``text output``: what the block above must have printed, a line ``…`` being any lines or
  none; ``text``: shown, and no code;
- ``LANGUAGE not run: REASON``: listed in `NOT_RUN`.

The recipes of CONTRIBUTING.md are done in ``test_recipes.py``, directives in the site's build.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from markdown_it import MarkdownIt
from sblcosim.models import COMPONENTS, RECEIVERS
from sblcosim.report.paper.numbers import facts
from sblcosim.study.study import load

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RECIPES = ROOT / "CONTRIBUTING.md"
ROOMS = ("models", "fmus", "orchestrator", "tests", "tools")
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CHANGELOG.md")), RECIPES,
    *sorted(path for path in ROOT.glob("docs/**/*.md") if "made" not in path.parts),
    *sorted(path for name in ROOMS for path in (ROOT / name).rglob("README.md")),
    ROOT / "fmus" / "conformance" / "FOREIGN.md",
]  # fmt: skip
NOT_RUN = {
    ".ci/run does": 1,
    "it installs": 3,
    "it needs a log": 1,
    "it needs make, qemu and a compiler for ARM": 2,
    "it needs the device": 1,
    "tests/acceptance/test_site.py builds the site": 1,
    "takes minutes; its parts are tested one by one": 4,
    "takes minutes, and a time is no test": 4,
    "needs the FMUs of others": 1,
    "evo keeps settings in the home folder": 1,
}
"""How many blocks are not run, by the reason that they give."""
PIECES = {"docs/howto/study.md": ("boats", "space", "worst"), "docs/tutorial.md": ("my-study",)}
"""Of long pages: words of the blocks that need nothing of the others but the files saved there."""


@dataclass(frozen=True)
class Block:
    """A block of code: what stands after its fence, and its text."""

    language: str
    rest: str
    text: str
    line: int


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def blocks(path: Path) -> list[Block]:
    """The blocks of a page, without directives."""
    found = []
    for token in MarkdownIt().parse(path.read_text("utf-8")):
        if token.type == "fence" and not token.info.startswith("{"):
            language, _, rest = token.info.strip().partition(" ")
            found.append(Block(language, rest, token.content, (token.map or [0])[0] + 1))
    return found


def reason(block: Block) -> str:
    """Why a block is not run; empty if it is."""
    return block.rest.partition("not run: ")[2]


def printed(text: str) -> re.Pattern[str]:
    """What is printed as a text says, in which a line of dots stands for any lines or none."""
    lines = (r"(?:.*\n)*" if line == "…" else re.escape(line) + r"\n" for line in text.splitlines())
    return re.compile("".join(lines))


class Page:
    """A folder in which the blocks of a page are run, one after the other."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.printed = folder, ""
        self.names: dict[str, Any] = {"__name__": "__main__"}

    def take(self, block: Block, capsys: pytest.CaptureFixture[str]) -> None:
        kind = (block.language, block.rest)
        if block.language in ("python", "toml") and block.rest:
            (self.folder / block.rest).write_text(block.text, "utf-8")
        if block.language == "python":
            exec(compile(block.text, f"line {block.line}", "exec"), self.names)
            self.printed = capsys.readouterr().out
        elif block.language == "toml":
            tomllib.loads(block.text)
        elif kind in (("sh", ""), ("sh", "warns")):
            self.printed = self.run(block.text, warns=block.rest == "warns")
        elif kind == ("text", "output"):
            assert printed(block.text).fullmatch(self.printed), self.printed
        else:
            assert kind == ("text", ""), f"line {block.line}: nothing is done with {kind}"

    def run(self, commands: str, *, warns: bool) -> str:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", commands], cwd=self.folder, text=True, check=False,
            capture_output=True, env=os.environ | {"PATH": path},
        )  # fmt: skip
        assert done.returncode == 0, f"{commands}\n{done.stdout}\n{done.stderr}"
        assert ("warning" in done.stderr) == warns, done.stderr
        return done.stdout


LONG = {
    "boat", "budget", "compare", "conformance", "device-log", "dives", "explore", "json", "log",
    "look-back", "map", "other-tools", "own-system", "ranging", "receiver", "require", "scenario",
    "study",
}
"""Pages whose code takes long; `pytest -m slow` runs it."""
WITH_CODE = [
    path for path in DOCUMENTS if path != RECIPES and any(not reason(b) for b in blocks(path))
]


def of_pieces(path: Path) -> dict[str, list[Block]]:
    """The blocks that are run, by the word of their piece; saved files are in all pieces."""
    words = PIECES.get(name_of(path), ())
    found: dict[str, list[Block]] = {word: [] for word in ("", *words)}
    piece = ""
    for block in blocks(path):
        if reason(block):
            continue
        if block.language in ("python", "toml") and block.rest:
            for piece_ in found.values():
                piece_.append(block)
            continue
        if block.language != "text":  # what is printed is of the block above
            piece = next((word for word in words if word in block.text), "")
        found[piece].append(block)
    return found


@pytest.mark.parametrize(
    ("path", "piece"),
    [
        pytest.param(path, word, id=name_of(path) + (f" {word}" if word else ""),
                     marks=[pytest.mark.slow] if path.stem in LONG else [])
        for path in WITH_CODE for word in of_pieces(path)
    ],
)
def test_the_code_of_a_document_runs(
    path: Path, piece: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    page = Page(tmp_path)
    for block in of_pieces(path)[piece]:
        page.take(block, capsys)


@pytest.mark.parametrize("page", PIECES)
def test_the_pieces_of_a_page_are_all_of_it(page: str) -> None:
    pieces = of_pieces(ROOT / page)
    run = [block.line for block in blocks(ROOT / page) if not reason(block)]
    assert sorted({block.line for own in pieces.values() for block in own}) == run
    assert all(any(block.language == "sh" for block in own) for own in pieces.values())


def test_what_is_not_run_says_why() -> None:
    told = Counter(why for path in DOCUMENTS for b in blocks(path) if (why := reason(b)))
    assert dict(told) == NOT_RUN


def test_a_block_that_nothing_is_done_with_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(AssertionError, match="line 3: nothing is done"):
        Page(tmp_path).take(Block("sh", "some day", "true\n", 3), capsys)


def test_output_that_is_not_what_was_printed_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = Page(tmp_path)
    page.take(Block("sh", "", "echo first; echo yes; echo last\n", 1), capsys)
    for text in ("first\nyes\nlast\n", "…\nyes\n…\n", "…\nfirst\n…\nlast\n…\n"):
        page.take(Block("text", "output", text, 4), capsys)
    for text in ("yes\n", "…\nno\n…\n", "…\nyes\n"):
        with pytest.raises(AssertionError):
            page.take(Block("text", "output", text, 4), capsys)


def test_the_components_that_are_built_are_those_that_are_named() -> None:
    text = (DOCS / "howto" / "other-tools.md").read_text("utf-8")
    listed = text[text.index("`fmus/fmi2/*.fmu`") : text.index("They need no runtime")]
    named = {*re.findall(r"`(\w+)`", listed)}
    assert named <= {*COMPONENTS}
    assert named | {*RECEIVERS} == {*COMPONENTS}


def test_every_model_folder_has_a_readme() -> None:
    folders = [f.parent for f in sorted(ROOT.glob("models/*/variables.py"))]
    assert len(folders) == 5
    assert all((folder / "README.md").is_file() for folder in folders)


@pytest.mark.parametrize("path", DOCUMENTS, ids=name_of)
def test_files_that_a_document_names_exist(path: Path) -> None:
    text = path.read_text("utf-8")
    links = re.findall(r'(?:src|srcset)="([^"]+)"|\]\(([^)#:]+)(?:#[^)]*)?\)', text)
    folders = "tests|tools|benchmarks|examples|models|fmus|orchestrator|docs"
    named = re.findall(rf"`((?:{folders})/[\w/.-]+\.\w+)`", text)
    for name in [*(a or b for a, b in links), *named]:
        if not name.startswith(("fmus/fmi2/", "fmus/fmi3/")):  # `sblcosim build` makes these
            assert (path.parent / name).exists() or (ROOT / name).exists(), name


@pytest.mark.parametrize("name", [
    "docs/howto/receiver.md", "docs/howto/conformance.md", "docs/howto/other-tools.md",
    "orchestrator/simulation/README.md",
])
def test_where_a_process_of_its_own_is_promised_its_limits_are_too(name: str) -> None:
    text = " ".join((ROOT / name).read_text("utf-8").split())
    assert "faults, not malice" in text


ONLY_ON_THE_SITE = re.compile(r"<!-- on the site\n.*?-->", re.DOTALL)


def test_a_page_has_its_text_in_the_file() -> None:
    """What a reader of the repository would see of directives and includes is markup."""
    pages = [path for path in DOCUMENTS if DOCS in path.parents]
    assert len(pages) > 20
    for path in pages:
        seen = ONLY_ON_THE_SITE.sub("", path.read_text("utf-8"))
        assert not re.search(r"^(```|:::) *\{|^% ", seen, re.MULTILINE), path
        prose = re.sub(r"^#.*$", "", re.sub(r"<!--.*?-->", "", seen, flags=re.DOTALL), flags=re.M)
        assert len(prose.split()) > 60, f"{path}: has no text of its own"


def test_what_is_made_from_the_sources_is_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import reference

    texts = {path: path.read_text("utf-8") for path in reference.PAGES}
    used = [kind for text in texts.values() for kind in re.findall(r"<!-- made: (\w+)", text)]
    assert {*used} == {*reference.KINDS}
    for path, text in texts.items():
        assert reference.current(text) == text, f"{path}: run python tools/reference.py"
        assert text.count("<!-- made: ") == text.count("<!-- end -->")


def test_a_page_that_is_not_as_the_sources_are_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import reference

    text = (DOCS / "reference" / "scenario.md").read_text("utf-8")
    assert reference.current(text.replace("`fmi`", "`fmu`")) == text


def test_conditions_of_keys_are_in_the_words_of_a_scenario_file() -> None:
    text = (DOCS / "reference" / "scenario.md").read_text("utf-8")
    conditions = re.findall(r" Used if (.+?)\.(?: Derived from| \|)", text)
    assert len(conditions) > 80
    assert not [it for it in conditions if re.search(r"is (not )?`\d`", it)]
    paths = re.findall(r"`trajectory` is ([^;\n]*)", "\n".join(conditions))
    listed = [it.count("`") // 2 for it in paths]
    assert listed
    assert max(listed) <= 4  # of nine trajectories


def test_the_study_on_the_page_is_the_included_one() -> None:
    page = DOCS / "howto" / "ranging.md"
    shown = next(block.text for block in blocks(page) if block.rest == "ways.toml")
    assert shown == (ROOT / "orchestrator/study/shipped/ways-to-range.toml").read_text("utf-8")


def test_what_is_cited_is_what_this_is() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    for key in ("version", "license", "keywords"):
        assert cited[key] == project[key]
    assert f"## [{cited['version']}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")
    (paper,) = cited["references"]
    citation = facts()["citation"]
    names = ", ".join(author["family-names"] for author in paper["authors"])
    assert citation.startswith(f"{names}; {paper['journal']} {paper['year']}")
    assert citation.endswith(paper["doi"])
    assert paper["title"] == facts()["title"]


def test_the_designs_that_a_study_may_have(tmp_path: Path) -> None:
    page = ROOT / "docs" / "howto" / "study.md"
    (tmp_path / "my-study.toml").write_text(blocks(page)[0].text)
    study = load(tmp_path / "my-study.toml")
    assert len(study.points.values) == 8
    for design in (
        {"kind": "fraction", "generators": ["C=AB"]},
        {"kind": "fraction", "resolution": 3},
        {"kind": "full", "centre_points": 5},
    ):
        tables = study.model_dump(exclude_unset=True) | {"design": design}
        assert len(load(tables).points.values) in (4, 13)
