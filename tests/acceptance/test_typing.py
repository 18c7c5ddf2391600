"""What a type checker and an editor know: the documents' lines, and the keys of a scenario."""

from __future__ import annotations

import json
import os
import re
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import sblcosim
from sblcosim.scenario.scenario import Scenario

ROOT = Path(__file__).parents[2]
CHECKERS = (pytest.param("mypy", marks=pytest.mark.slow), "basedpyright")

GOOD = '''
from collections.abc import Sequence
from typing import Any

import sblcosim
from sblcosim import Depth, Estimate, Overrides, Range

sblcosim.run("a", overrides={"platform.arm_length_m": 0.4, "seed": 7, "fmi": 3})
sblcosim.run("a", "coupled", {"time.sampling_time_s": 1, "target.trajectory": "circle"})
sblcosim.run("a", overrides={"platform": {"arm_length_m": 0.4}})
sblcosim.run("a", overrides=["platform.arm_length_m=0.4"])
known: Overrides = {"platform.beaufort": None, "target.waypoint_m": [[0.0, 0.0, 1.0], [5, 0, 1]]}
known["time.duration_s"] = "path"
sblcosim.load("a", known).override(known)
computed = {f"platform.{name}": 0.4 for name in ("arm_length_m", "beacon_depth_m")}
sblcosim.run("a", overrides=computed.items())
anything: dict[str, Any] = {"platform.arm_length_m": 0.4, "target.turns": 2}
sblcosim.smooth("runs/a", anything.items())
for name, title in sblcosim.scenarios().items():
    print(name.upper(), title.upper(), sblcosim.receivers()["ekf"].upper())


class Mine(sblcosim.Receiver):
    def update(self, samples: Sequence[Range | Depth]) -> Estimate | None:
        heard = [s for s in samples if isinstance(s, Range)]
        return Estimate(heard[-1].epoch, heard[-1].beacon_position) if heard else None


result = sblcosim.run("a", {"mine": Mine})
result.plot_path(theme="dark").figure.savefig("path.png")
result.plot_errors().axes[0].set_title("mine")
result.to_xarray()["error"].sel(axis="x").mean("epoch")
found = sblcosim.compare(["a", "b.toml"], ["ekf", Mine], overrides={"time.duration_s": 5.0})
found.plot(theme="dark").savefig(found.answer)
sblcosim.run_many("a", runs=20).drawn["typical"].plot_path()
'''
BAD = '''
import sblcosim

sblcosim.run("a", overrides={"platform.arm_lenght_m": 0.4})
sblcosim.run("a", overrides={"platform.arm_length_m": "0.4"})
sblcosim.run("a", overrides={"target.trajectory": "triangle"})
sblcosim.run("a", overrides={"seed": 1, "platform.arm_length": 0.4})
sblcosim.load("a", {"arm_length_m": 0.4})
sblcosim.load("a").override({"seed": 1.5})
sblcosim.smooth("runs/a", {"receiver.clock_std": 1.0})
sblcosim.export_ssp("a", "a.ssp", overrides={"seeds": 3})
sblcosim.run("a").plot_path(theme="blue")
sblcosim.no_such_name
sblcosim.analysis.no_such_name
sblcosim.study.no_such_name
sblcosim.limits.no_such_name
'''


def blocks() -> dict[str, str]:
    """The Python in the README and the documents, by a name for each block."""
    found = {}
    for path in (ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))):
        page = "_".join(path.relative_to(ROOT).with_suffix("").parts).replace("-", "_").lower()
        texts = re.findall(r"(?ms)^```python[^\n]*\n(.*?)^```", path.read_text())
        found |= {f"{page}_{i}.py": text for i, text in enumerate(texts, 1)}
    return found


BLOCKS = blocks()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files, and beside them the package where it is not installed as checkers look for it."""
    folder = tmp_path_factory.mktemp("typing")
    for name, text in {**BLOCKS, "good.py": GOOD, "bad.py": BAD}.items():
        (folder / name).write_text(text)
    package = Path(sblcosim.__path__[0])
    if package.name != "sblcosim":
        (folder / "sblcosim").mkdir()
        for inner in (*package.iterdir(), ROOT / "models", ROOT / "fmus"):
            (folder / "sblcosim" / inner.name).symlink_to(inner)
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> Callable[[str], set[tuple[str, int, str]]]:
    """What each checker says: file, line and message."""
    return cache(lambda checker: {"mypy": mypy, "basedpyright": basedpyright}[checker](folder))


def run_mypy(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run mypy; what it has found out about the package it keeps for the next one."""
    pytest.importorskip("mypy")
    installed = not (folder / "sblcosim").exists()
    cache = ROOT / ".mypy_cache" if installed else folder / "cache"
    command = [
        sys.executable, "-m", "mypy", "--strict", "--config-file", str(ROOT / "pyproject.toml"),
        "--cache-dir", str(cache), *arguments,
    ]  # fmt: skip
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.slow
def test_the_package_is_typed(folder: Path) -> None:
    done = run_mypy(folder, "-p", "sblcosim")
    assert done.returncode == 0, done.stdout + done.stderr


def mypy(folder: Path) -> set[tuple[str, int, str]]:
    files = sorted(p.name for p in folder.glob("*.py"))
    done = run_mypy(folder, "--output", "json", *files)
    assert done.returncode == 1, done.stderr
    lines = map(json.loads, done.stdout.splitlines())
    return {(m["file"], m["line"], m["message"]) for m in lines if m["severity"] == "error"}


def basedpyright(folder: Path) -> set[tuple[str, int, str]]:
    pytest.importorskip("basedpyright")
    config: dict[str, Any] = {"include": ["*.py"], "typeCheckingMode": "standard"}
    (folder / "pyrightconfig.json").write_text(json.dumps(config))
    command = [
        sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable,
        "--project", str(folder),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    assert report["summary"]["filesAnalyzed"] == len(list(folder.glob("*.py")))
    return {
        (Path(m["file"]).name, m["range"]["start"]["line"] + 1, m["message"])
        for m in report["generalDiagnostics"]
        if m["severity"] == "error"
    }


@pytest.mark.parametrize("checker", CHECKERS)
def test_the_lines_of_the_documents_are_typed(found: Any, checker: str) -> None:
    assert "readme_1.py" in BLOCKS
    assert {problem for problem in found(checker) if problem[0] in BLOCKS} == set()


@pytest.mark.parametrize("checker", CHECKERS)
def test_what_is_right_passes_without_a_cast(found: Any, checker: str) -> None:
    assert {problem for problem in found(checker) if problem[0] == "good.py"} == set()


@pytest.mark.parametrize("checker", CHECKERS)
def test_a_wrong_key_or_type_is_an_error(found: Any, checker: str) -> None:
    wrong = {i for i, line in enumerate(BAD.splitlines(), 1) if line.startswith("sblcosim.")}
    assert {line for file, line, _ in found(checker) if file == "bad.py"} == wrong


def test_the_typed_keys_are_those_of_a_scenario() -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "keys.py"))
    assert tool["FILE"].read_text("utf-8") == tool["text"](), "run: python tools/keys.py"
    tables = {k: f.annotation for k, f in Scenario.model_fields.items()}
    every = {
        name
        for key, kind in tables.items()
        for name in (key, *(f"{key}.{k}" for k in getattr(kind, "model_fields", ())))
    }
    assert set(sblcosim.Overrides.__annotations__) == every
    assert "platform.arm_length_m" in every


def test_an_editor_completes_the_keys(folder: Path) -> None:
    pytest.importorskip("basedpyright")
    text = 'import sblcosim\nsblcosim.run("a", overrides={"platform.arm": 0.4})\n'
    offered = completions(folder, text, line=1, character=text.splitlines()[1].index("arm") + 3)
    assert "platform.arm_length_m" in {label.strip("\"'") for label in offered}


PATIENCE = 300
"""How often an editor asks."""


def completions(folder: Path, text: str, line: int, character: int) -> list[str]:
    """What the language server of an editor offers at a place."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    server = subprocess.Popen(
        [sys.executable, "-c", "from basedpyright.langserver import main; main()", "--stdio"],
        cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        env={**os.environ, "PATH": path},
    )  # fmt: skip
    assert server.stdin is not None
    assert server.stdout is not None

    def send(method: str, number: int | None = None, **params: Any) -> None:
        message = {"jsonrpc": "2.0", "method": method, "params": params}
        body = json.dumps(message if number is None else {**message, "id": number}).encode()
        server.stdin.write(f"Content-Length: {len(body)}\r\n\r\n".encode() + body)  # type: ignore[union-attr]
        server.stdin.flush()  # type: ignore[union-attr]

    def answer(number: int) -> Any:
        while True:
            size = 0
            while (head := server.stdout.readline().strip()) != b"":  # type: ignore[union-attr]
                if head.lower().startswith(b"content-length:"):
                    size = int(head.partition(b":")[2])
            message = json.loads(server.stdout.read(size))  # type: ignore[union-attr]
            if message.get("id") == number and "method" not in message:
                return message["result"]

    uri = (folder / "edited.py").as_uri()
    try:
        send("initialize", 1, processId=None, rootUri=folder.as_uri(), capabilities={})
        answer(1)
        send("initialized")
        document = {"uri": uri, "languageId": "python", "version": 1, "text": text}
        send("textDocument/didOpen", textDocument=document)
        place = {"line": line, "character": character}
        for number in range(2, 2 + PATIENCE):  # it answers before it has read everything
            send("textDocument/completion", number, textDocument={"uri": uri}, position=place)
            found = answer(number)
            if found and (not isinstance(found, dict) or found["items"]):
                break
            time.sleep(1.0)
    finally:
        os.killpg(server.pid, signal.SIGKILL)  # it has a child
        server.wait()
    items = found["items"] if isinstance(found, dict) else found or []
    return [item["label"] for item in items]
