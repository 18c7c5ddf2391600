"""The texts read as English: no idioms and no word order of another language.

Only the worst patterns are here, those that no English sentence needs. The texts are docstrings,
comments and messages of the sources, and whole pages of Markdown.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

RULES = {
    "left away": r"\bleft away\b",
    "so many": r"\bso (?:many|much)\b",
    "of which": r"\b(?:that|those) of which\b|\bof which nothing\b",
    "warned of": r"\b[Ww]arn(?:s|ed)? of\b",
    "inside of": r"\b(?:inside|outside) of\b",
    "along": r"\b(?:come|comes|came|coming) along\b",
    "average": r"\bon the average\b",
    "ours": r"\bnone of ours\b",
    "anew": r"\b(?:begin|begins|start|starts) anew\b",
    "participle first":
        r"(?:^|[.!?]\s+)(?:Not [a-z]+|(?!Need|Seed|Speed)[A-Z][a-z]+)"
        r"(?:(?<=ed)|(?<=nown)|(?<=ritten)|(?<=iven)|(?<=roken)|(?<=een)|(?<=aken))"
        r" (?:is|are|was|were)\b",
    "no noun": r"\bwhat there is\b|\bof such as\b",
}
"""Regular expressions by name. They match texts on one line."""

NOT_YET = ("tests/",)
"""Files and folders whose texts have not been revised. Remove an entry when they have."""


def texts() -> Iterator[tuple[str, str]]:
    """Place and text of each piece of prose, each on one line."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(
            ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT, check=True, capture_output=True, text=True,
        ).stdout.splitlines()
    else:  # a copy, without what git ignores
        listed = [path.relative_to(ROOT).as_posix() for path in sorted(ROOT.rglob("*"))]
    for name in listed:
        path = ROOT / name
        if path.suffix in PROSE and is_covered(name) and path.is_file():
            for line, text in PROSE[path.suffix](path.read_text("utf-8")):
                yield f"{name}:{line}", " ".join(text.split())


def is_covered(name: str) -> bool:
    """Whether the texts of a file have been revised."""
    alone = f"{name.rpartition('/')[0]}/*.py" if name.endswith(".py") else ""
    return not any(name.startswith(it) or alone == it for it in NOT_YET)


def of_python(source: str) -> Iterator[tuple[int, str]]:
    """Strings, with values left out, and comments, those on consecutive lines together."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            for paragraph in node.value.split("\n\n"):
                yield node.lineno, paragraph
    last, start, block = -1, 0, ""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            if token.start[0] != last + 1:
                yield start, block
                start, block = token.start[0], ""
            last, block = token.start[0], f"{block} {token.string.lstrip('#: ')}"
    yield start, block


def of_c(source: str) -> Iterator[tuple[int, str]]:
    """Comments and strings."""
    for found in re.finditer(r'/\*.*?\*/|"(?:\\.|[^"\\\n])*"', source, re.DOTALL):
        text = re.sub(r"\n\s*\*", " ", found[0]).strip('/*" ')
        yield source.count("\n", 0, found.start()) + 1, text


def of_page(source: str) -> Iterator[tuple[int, str]]:
    """Paragraphs and rows of tables outside code, and outside what is made from other sources."""
    skipped = r"```.*?```|<!-- made:.*?<!-- end -->"
    bare = re.sub(skipped, lambda m: "\n" * m[0].count("\n"), source, flags=re.DOTALL)
    line = 1
    for paragraph in re.split(r"(\n\n|\n(?=[|#-]))", bare):
        yield line, paragraph
        line += paragraph.count("\n")


def of_settings(source: str) -> Iterator[tuple[int, str]]:
    """Comments of a TOML file."""
    for number, line in enumerate(source.splitlines(), 1):
        yield number, line.partition("# ")[2]


PROSE = {".py": of_python, ".c": of_c, ".h": of_c, ".md": of_page, ".toml": of_settings}


def test_the_texts_have_no_words_in_the_order_of_another_language():
    found = [
        f"{place}: {name}: …{text[max(match.start() - 30, 0):match.end() + 30]}…"
        for place, text in texts()
        for name, rule in RULES.items()
        for match in re.finditer(rule, text)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(("rule", "text"), [
    ("left away", "A column without values is left away."),
    ("so many", "Divers at once: so many as fit."),
    ("of which", "The key, and that of which it is made."),
    ("warned of", "Warned of are keys without effect."),
    ("inside of", "A file inside of the folder."),
    ("along", "The raw fix comes along."),
    ("average", "It is better on the average."),
    ("ours", "A component that is none of ours."),
    ("anew", "The filter starts anew."),
    ("participle first", "Analysed is the logarithm of the response."),
    ("participle first", "It has a factor. Not seen are random states."),
    ("no noun", "Variables that show what there is."),
])
def test_each_rule_finds_what_it_is_for(rule, text):
    assert re.search(RULES[rule], text)


@pytest.mark.parametrize("text", [
    "The filter restarts once 20 ranges have been rejected.",
    "Columns that too few runs cannot fill are left out.",
    "The range needed is 15 m. Speed is constant.",
])
def test_no_rule_finds_plain_english(text):
    assert not any(re.search(rule, text) for rule in RULES.values())


def test_what_is_not_covered_yet_exists():
    for name in NOT_YET:
        assert [*ROOT.glob(name.rstrip("/"))], name


@pytest.mark.parametrize(("suffix", "source", "expected"), [
    (".py", '"""First.\n\nSecond\nline."""\n# one\n# two\nx = f"left {1} away"\n',
     ["First.", "Second line.", "left", "away", "one two"]),
    (".c", '/* One\n * two. */ report("three");', ["One two.", "three"]),
    (".md", "A line\nand more\n\n```sh\ncode\n```\n- an item\n", ["A line and more", "- an item"]),
    (".md", "One\n\n<!-- made: x -->\n\nmade\n\n<!-- end -->\n\ntwo", ["One", "two"]),
    (".toml", "a = 1  # one\n", ["one"]),
])
def test_prose_is_found_wherever_it_stands(suffix, source, expected):
    found = [" ".join(text.split()) for _, text in PROSE[suffix](source)]
    assert [text for text in found if text] == expected
