"""Python files that misbehave: one line and a code, whatever they do and wherever, and no harm.

They are run by child processes. What each does is in `DEEDS`, where it does it in `PLACES`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sblcosim
from quick import few, one_in
from sblcosim.cli import app
from sblcosim.errors import ConfigurationError, SblcosimError
from sblcosim.scenario.sources import known_source
from sblcosim.simulation.children import children
from sblcosim.simulation.children import process as child_process
from sblcosim.simulation.children.children import waiting
from sblcosim.simulation.user.files import for_others
from sblcosim.study import study
from seams import Seam
from typer.testing import CliRunner

SCENARIO = "harbour-square"
SHORT = {"time.duration_s": 2.0}

FATAL = {
    "os_exit_0": ("import os; os._exit(0)", "ended the process (exit code 0) in "),
    "os_exit_7": ("import os; os._exit(7)", "ended the process (exit code 7) in "),
    "segv": ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "(signal SIGSEGV) in "),
    "null": ("import ctypes; ctypes.string_at(0)", "crashed (signal SIGSEGV) in "),
    "abort": ("import os; os.abort()", "crashed (signal SIGABRT) in "),
    "kill": ("import os, signal; os.kill(os.getpid(), 9)", "crashed (signal SIGKILL) in "),
    "term": ("import os, signal; os.kill(os.getpid(), 15)", "crashed (signal SIGTERM) in "),
    "fpe": ("import os, signal; os.kill(os.getpid(), signal.SIGFPE)", "(signal SIGFPE) in "),
    "alarm": ("import signal, time; signal.alarm(1); time.sleep(300)", "(signal SIGALRM) in "),
    "thread_exit": (
        "import os, threading, time; threading.Thread(target=os._exit, args=(3,)).start()\n"
        "time.sleep(300)",
        "ended the process (exit code 3) in ",
    ),
    "exec": ("import os; os.execv('/bin/true', ['true'])", "the process (exit code 0) in "),
    "all_files_closed": (
        "import os; os.closerange(0, 1000); os._exit(0)", "ended the process (exit code 0) in "
    ),
    "killed_group": (
        "import os, signal; os.killpg(0, signal.SIGKILL)", "crashed (signal SIGKILL) in "
    ),
}  # fmt: skip
"""What ends the process: the code, and what is said of it."""

RAISED = {
    "raise": ("raise ValueError('no')", "ValueError: no"),
    "exit": ("import sys; sys.exit(3)", "SystemExit: 3"),
    "exit_0": ("raise SystemExit(0)", "SystemExit: 0"),
    "interrupt": ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    "base": ("class Odd(BaseException): pass\nraise Odd('here')", "Odd: here"),
    "generator_exit": ("raise GeneratorExit", "GeneratorExit"),
    "broken_str": (
        "class Odd(Exception):\n    def __str__(self): raise TypeError\nraise Odd",
        "Odd: its text cannot be shown",
    ),
    "base_str": (
        "class Odd(BaseException):\n    def __str__(self): raise SystemExit\nraise Odd",
        "Odd: its text cannot be shown",
    ),
    "lines": ("raise ValueError('a\\nb\\r\\nc')", "ValueError: a b c"),
    "long": ("raise ValueError('x' * 10**6)", "ValueError: xxx"),
    "recursion": ("def f(): f()\nf()", "RecursionError: "),
    "group": ("raise ExceptionGroup('g', [ValueError('no')])", "ExceptionGroup: g"),
    "stop": ("raise StopIteration('s')", "StopIteration: s"),
    "array": (
        "class Odd:\n    def __array__(self, *_, **__): raise BaseException('odd')\n"
        "import numpy; numpy.asarray(Odd())", "BaseException: odd",
    ),
    "memory": ("raise MemoryError('much')", "MemoryError: much"),
    "own_error": (
        "from sblcosim.errors import ConfigurationError\n"
        "class Mine(ConfigurationError): pass\nraise Mine('mine')", "mine",
    ),
    "no_module": ("import there_is_no_such_module", "ModuleNotFoundError: No module named"),
    "broken_pipe": ("raise BrokenPipeError(32, 'Broken pipe')", "BrokenPipeError: "),
}
"""What raises something: the code, and what is said of it."""

HARMLESS = {
    "chdir": "import os; os.chdir('/')",
    "stdout_closed": "import sys; sys.stdout.close()",
    "stderr_closed": "import sys; sys.stderr.close()",
    "stdout_gone": "import sys; sys.stdout = None",
    "prints": "print('{\"not\": \"json\"')",
    "flood": "print('flood ' * 20_000)",
    "fd_1_closed": "import os; os.dup2(os.open(os.devnull, os.O_RDONLY), 1)",
    "writes_to_1": "import os; os.write(1, b'raw')",
    "environment": "import os; os.environ.clear(); os.environ['SBLCOSIM_CACHE'] = '/nowhere'",
    "signals": "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)",
    "locale": "import locale; locale.setlocale(locale.LC_ALL, 'C')",
    "seterr": "import numpy; numpy.seterr(all='raise')",
    "warns": "import warnings; warnings.warn('careful')",
    "limit": "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))",
    "thread": "import threading, time\n"
              "threading.Thread(target=time.sleep, args=(600,), daemon=True).start()",
    "json": "import json, pickle; json.dumps = None",
    "path": "import sys; sys.path.clear()",
    "settrace": "import sys; sys.settrace(lambda *_: None)",
    "recursion_limit": "import sys; sys.setrecursionlimit(10_000)",
    "fork": "import os\nif not hasattr(os, 'forked'): os.forked = 1; os.fork()",
    "umask": "import os; os.umask(0o777)",
    "np_sqrt": "import numpy as np; np.hypot = lambda *_: 1 / 0",
}  # fmt: skip
"""What leaves something changed, and goes on."""

RUIN = {
    "zeros": "import numpy as np; np.zeros = lambda *_, **__: None",
    "asarray": "import numpy as np; np.asarray = None",
    "len": "import builtins; builtins.len = None",
    "modules": "import sys; sys.modules.clear()",
    "files": "import os; os.closerange(3, 300)",
    "isinstance": "import builtins; builtins.isinstance = lambda *_: 1 / 0",
}
"""What also takes away what our own code needs."""

RECEIVER = '''
import numpy as np
import sblcosim
DONE = False

def deed(where):
    if where != {place!r}:
        return
{deed}

deed("import")

class Mine(sblcosim.Receiver):
    def __init__(self):
        deed("constructor")

    @property
    def variables(self):
        deed("variables")
        return super().variables

    def initialise(self, start_ns, parameters):
        deed("initialise")
        return super().initialise(start_ns, parameters)

    def update(self, samples):
        deed("do_step")
        return sblcosim.Estimate(samples[-1].epoch, (1.0, 2.0, 3.0))

def response(run):
    deed("response")
    return 1.0

def model(gps, seed):
    deed("model")
    return gps
'''
FOLDER = '''
from sblcosim.models.receiver.receiver import ReceiverDeclaration
from sblcosim.models.receiver.variables import receiver

def deed(where):
    if where != {place!r}:
        return
{deed}

class Name(str):
    def __repr__(self):
        deed("declaration")
        return super().__repr__()

def equations():
    deed("equations")

deed("import")
RECEIVER = ReceiverDeclaration(
    receiver(Name("Mine"), 1000, "Mine", ()), purpose="tests", equations=equations
)
'''
FOLDERS = {"folder": "import", "declaration": "declaration", "equations": "equations"}
"""Places in a folder with a receiver that becomes an FMU."""
EARLY, LATE = ("import", "constructor", "variables"), ("initialise", "do_step")
CALLS = {
    "import": "its import", "constructor": "its constructor", "variables": "variables",
    "initialise": "initialise", "do_step": "do_step", "response": "its call", "model": "its call",
    "folder": "its import", "declaration": "its declaration", "equations": "its equations",
}  # fmt: skip
NOTHING = "pass"
LOOP = (
    "import os, tempfile\n"
    "open(os.path.join(tempfile.gettempdir(), 'hangs'), 'w').close()\n"
    "while True: pass"
)
"""It says so first: time counts from then on (`only_hangs_take_time`)."""


def written(folder: Path, place: str, deed: str, name: str = "mine.py") -> Path:
    lines = "\n".join(f"    {line}" for line in deed.splitlines())
    if place in FOLDERS:
        made, text = folder / "mine", FOLDER.format(place=FOLDERS[place], deed=lines)
        made.mkdir()
        (made / "receiver.py").write_text(text)
        return made
    (folder / name).write_text(RECEIVER.format(place=place, deed=lines))
    return folder / name


def command(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sblcosim", *map(str, words)],
        capture_output=True, text=True, check=False, cwd=cwd,
    )  # fmt: skip


@pytest.fixture(scope="module")
def alone() -> sblcosim.Result:
    return sblcosim.run(SCENARIO, "ekf", SHORT)


def shared() -> tuple[Any, ...]:
    """What the code of this process shares."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    return (os.getcwd(), environment, np.zeros, np.hypot, json.dumps, len, sys.stdout.closed)


@pytest.fixture(autouse=True)
def _nothing_is_changed() -> Iterator[None]:
    before = shared()
    yield
    assert shared() == before


def same(result: sblcosim.Result, other: sblcosim.Result, receivers: tuple[str, ...]) -> None:
    for name, values in other.record.values.items():
        if name.partition(".")[0] in receivers:
            assert values.tobytes() == result.record.values[name].tobytes(), name


def one_line(message: str) -> str:
    assert len(message.splitlines()) == 1
    assert len(message) < 1000
    assert "this must not happen" not in message
    assert "Traceback" not in message
    return message


def asked(place: str, file: Path, out: Path, seconds: float | None = None) -> Any:
    """Let a file do at a place what it does there."""
    if place in (*EARLY, *LATE, *FOLDERS):
        return sblcosim.run(SCENARIO, ["ekf", str(file)], SHORT, step_timeout=seconds)
    tables: dict[str, Any] = {"scenario": SCENARIO, "fixed": SHORT, "design": {"kind": "single"},
                              "receivers": ["ekf"], "responses": [f"{file}:response"]}  # fmt: skip
    if place == "model":
        tables = {
            "model": f"{file}:model", "design": {"kind": "space", "base_rows": 16}, "seed": 3,
            "factors": {"gps": {"distribution": "uniform", "range": [1.0, 2.0]}},
        }  # fmt: skip
    return study.load(tables).run(out, step_timeout=seconds)


def failure(place: str, file: Path, out: Path, alone: sblcosim.Result, **options: Any) -> str:
    """What is said of a file that fails; the others' results are as without it."""
    if place in LATE:
        result = asked(place, file, out, **options)
        same(result, alone, ("target", "platform", "acoustics", "ekf", "raw"))
        assert result.receivers == ("ekf", "raw")
        return one_line(result.failures["Mine"])
    with pytest.raises(SblcosimError) as caught:
        asked(place, file, out, **options)
    return one_line(str(caught.value))


WHO = {
    "import": "receiver: the Python file mine.py ", "constructor": "Mine: the Python component ",
    "variables": "Mine: the Python component ", "initialise": "Mine: the Python component ",
    "do_step": "Mine: the Python component ", "response": "ekf.response: the response mine.py",
    "model": "model: the function mine.py:model ",
    **dict.fromkeys(FOLDERS, "receiver: the Python file receiver.py "),
}  # fmt: skip
DEEDS = [*FATAL, *RAISED]
PLACES = [*CALLS]
SOME = [(deed, PLACES[3 * i % len(PLACES)]) for i, deed in enumerate(DEEDS)]
"""Each deed somewhere, and at each place several."""
ALL = [(deed, place) for deed in DEEDS for place in PLACES]


def checked(deed: str, place: str, tmp_path: Path, alone: sblcosim.Result) -> None:
    text, words = FATAL.get(deed) or RAISED[deed]
    message = failure(place, written(tmp_path, place, text), tmp_path / "out", alone)
    if deed in FATAL:
        assert message.startswith(WHO[place])
        assert f"{words}{CALLS[place]}" in message
    else:
        assert words in message
        assert "must let its process go on" not in message
        named = "receiver.py" if place in FOLDERS else "mine.py"
        assert deed == "own_error" or named in message or place == "response"


@pytest.mark.parametrize(("deed", "place"), SOME)
@one_in(3)
def test_what_a_file_does_is_said_in_one_line_and_spares_the_others(
    deed: str, place: str, tmp_path: Path, alone: sblcosim.Result
) -> None:
    checked(deed, place, tmp_path, alone)


@pytest.mark.slow
@pytest.mark.parametrize(("deed", "place"), [case for case in ALL if case not in SOME])
def test_what_a_file_does_anywhere(
    deed: str, place: str, tmp_path: Path, alone: sblcosim.Result
) -> None:
    checked(deed, place, tmp_path, alone)


@pytest.mark.usefixtures("only_hangs_take_time")
@pytest.mark.parametrize("place", PLACES)
@one_in(3)
def test_what_does_not_return_is_given_up(
    place: str, tmp_path: Path, alone: sblcosim.Result
) -> None:
    file = written(tmp_path, place, LOOP)
    with child_process.patience(0.5):  # for what a study loads before it runs
        message = failure(place, file, tmp_path / "out", alone, seconds=0.5)
    assert message.startswith(WHO[place])
    assert f"has not returned from {CALLS[place]}" in message
    assert " for 0.5 s" in message


HARM = [*HARMLESS, *RUIN]


def later(cases: Iterable[str]) -> list[Any]:
    """Two of three are slow."""
    slow = pytest.mark.slow
    return [pytest.param(x, marks=[slow] if i % 3 else []) for i, x in enumerate(cases)]


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("beside"), "nowhere", NOTHING, "beside.py")


@pytest.fixture(scope="module")
def healthy(beside: Path) -> sblcosim.Result:
    return sblcosim.run(SCENARIO, str(beside), SHORT)


@pytest.mark.parametrize("deed", later(HARM))
@one_in(3)
def test_what_a_file_changes_reaches_nobody_else(
    deed: str, tmp_path: Path, alone: sblcosim.Result, beside: Path, healthy: sblcosim.Result
) -> None:
    places = (*EARLY, *LATE)
    place = places[HARM.index(deed) % len(places)]
    text = HARMLESS.get(deed) or RUIN[deed]
    file = written(tmp_path, place, text)
    others = {"ekf": "ekf", "good": str(beside)}
    try:
        result = sblcosim.run(SCENARIO, {**others, "bad": str(file)}, SHORT)
    except SblcosimError as error:
        assert deed in RUIN
        assert place in EARLY
        one_line(str(error))
        result = sblcosim.run(SCENARIO, others, SHORT)
    same(result, alone, ("target", "platform", "acoustics", "ekf", "raw"))
    for name, values in healthy.record.values.items():
        if name.startswith("Mine."):
            assert values.tobytes() == result.record.values[f"good{name[4:]}"].tobytes()
    if deed in HARMLESS:
        assert not result.failures
    for message in result.failures.values():
        one_line(message)


@pytest.mark.parametrize("deed", later(RUIN))
def test_what_a_file_takes_away_on_import_leaves_no_traceback(
    deed: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, "import", RUIN[deed])
    try:
        sblcosim.run(SCENARIO, {"ekf": "ekf", "bad": str(file)}, SHORT)
    except SblcosimError as error:
        one_line(str(error))
    said = capfd.readouterr()
    assert "Traceback" not in said.out + said.err


CHANGES = {
    "zeros": ("np.zeros = lambda *_, **__: None", "np.zeros(3) is None"),
    "hypot": ("np.hypot = lambda *_: 5.0", "np.hypot(3.0, 5.0) == 5.0"),
    "chdir": ("import os; os.chdir('/')", "os.getcwd() == '/'"),
    "environment": ("import os; os.environ['MINE'] = '1'", "'MINE' in os.environ"),
    "path": ("import sys; sys.path.insert(0, '/mine')", "'/mine' in sys.path"),
    "seterr": ("np.seterr(all='raise')", "np.geterr()['divide'] == 'raise'"),
    "recursion": ("import sys; sys.setrecursionlimit(5000)", "sys.getrecursionlimit() == 5000"),
    "stdout": ("import sys; sys.stdout = None", "sys.stdout is None"),
    "gc": ("import gc; gc.disable()", "not gc.isenabled()"),
    "signal": (
        "import signal; signal.signal(signal.SIGTERM, lambda *_: None)",
        "callable(signal.getsignal(signal.SIGTERM)) and signal.getsignal(15) is not signal.SIG_DFL",
    ),
    "our_class": (
        "import sblcosim.simulation.receiver as r; r.nanoseconds = lambda *_: 1",
        "__import__('sblcosim.simulation.receiver', fromlist='r').nanoseconds(1.0) == 1",
    ),
    "builtin": ("import builtins; builtins.sorted = list", "sorted is list"),
    "our_method": (
        "sblcosim.Receiver.fix = lambda *_: None",
        "sblcosim.Receiver.fix.__name__ == '<lambda>'",
    ),
    "constant": ("np.pi = 3.0", "np.pi == 3.0"),
    "warnings": (
        "import warnings; warnings.simplefilter('error')",
        "any(f[0] == 'error' for f in __import__('warnings').filters)",
    ),
}  # fmt: skip
AGAIN = '''
import gc, os, signal, sys
import numpy as np
import sblcosim

class Mine(sblcosim.Receiver):
    parameters = {{"wanted": False}}

    def start(self):
        self.found = bool({found})

    def update(self, samples):
        if self.wanted:
            {change}
        return sblcosim.Estimate(samples[-1].epoch, (float(self.found), 2.0, 3.0))
'''


@pytest.mark.parametrize("what", later(CHANGES))
def test_what_a_run_has_changed_is_gone_in_the_next_one_with_the_same_file(
    what: str, tmp_path: Path
) -> None:
    change, found = CHANGES[what]
    (tmp_path / "mine.py").write_text(AGAIN.format(change=change, found=found))
    wanted = {**SHORT, "receiver.parameters.wanted": True}
    results = [
        sblcosim.run(SCENARIO, ["ekf", str(tmp_path / "mine.py")], keys)
        for keys in (SHORT, wanted, SHORT)
    ]
    for result in (results[0], results[2]):
        assert result.record.values["Mine.position"][-1].tolist() == [0.0, 2.0, 3.0]


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[child_process.Process]]:
    waiting.close()
    made: list[child_process.Process] = []
    original = child_process.Process.__init__

    def counted(self: child_process.Process) -> None:
        made.append(self)
        original(self)

    monkeypatch.setattr(child_process.Process, "__init__", counted)
    yield made
    waiting.close()
    assert not any(child.alive for child in made)


def test_a_child_stays_for_its_file(started: list[child_process.Process], tmp_path: Path) -> None:
    file = written(tmp_path, "nowhere", NOTHING)
    first = sblcosim.run(SCENARIO, str(file), SHORT)
    again = sblcosim.run(SCENARIO, f"{file}:Mine", SHORT)
    same(again, first, first.receivers)
    assert len(started) == 1
    sblcosim.run(SCENARIO, str(written(tmp_path, "nowhere", NOTHING, "other.py")), SHORT)
    assert len(started) == 2
    written(tmp_path, "other", NOTHING)
    sblcosim.run(SCENARIO, str(file), SHORT)
    assert len(started) == 3
    assert all(child.alive for child in started)
    for number in range(children.FILES):
        sblcosim.run(SCENARIO, str(written(tmp_path, str(number), NOTHING)), SHORT)
    assert sum(child.alive for child in started) == children.FILES


def test_a_child_follows_its_parent(
    started: list[child_process.Process], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(
        "import os, sys, sblcosim\nclass Mine(sblcosim.Receiver):\n"
        "    def update(self, samples):\n"
        "        place = [float(os.environ['DEPTH']), len(sys.path), len(os.getcwd())]\n"
        "        return sblcosim.Estimate(samples[-1].epoch, place)\n"
    )
    for depth in ("1.5", "2.5"):
        monkeypatch.setenv("DEPTH", depth)
        monkeypatch.syspath_prepend(tmp_path)
        (tmp_path / (int(float(depth)) * "folder")).mkdir()
        monkeypatch.chdir(tmp_path / (int(float(depth)) * "folder"))
        result = sblcosim.run(SCENARIO, str(tmp_path / "mine.py"), SHORT)
        expected = [float(depth), len(sys.path), len(os.getcwd())]
        assert result.record.values["Mine.position"][-1].tolist() == expected
    assert len(started) == 1


def test_a_copy_of_a_child_answers_nothing(
    started: list[child_process.Process], tmp_path: Path
) -> None:
    deed = "import os\nif not hasattr(os, 'forked'): os.forked = 1; os.fork()"
    file = str(written(tmp_path, "do_step", deed))
    first, *others = [sblcosim.run(SCENARIO, file, SHORT) for _ in range(4)]
    for other in others:
        same(other, first, first.receivers)
    assert len(started) == 1


def test_two_classes_of_a_file_do_not_reach_each_other(tmp_path: Path) -> None:
    (tmp_path / "two.py").write_text(
        "import numpy as np\nimport sblcosim\nclass Bad(sblcosim.Receiver):\n"
        "    def update(self, samples):\n        np.hypot = lambda *_: 0.0\n"
        "class Good(sblcosim.Receiver):\n    def update(self, samples):\n"
        "        return sblcosim.Estimate(samples[-1].epoch, (np.hypot(3.0, 4.0), 0.0, 0.0))\n"
    )
    both = [f"{tmp_path}/two.py:Bad", f"{tmp_path}/two.py:Good"]
    result = sblcosim.run(SCENARIO, both, SHORT)
    assert result.record.values["Good.position"][-1, 0] == 5.0


def test_a_class_given_in_python_stays_in_this_process() -> None:
    here = []

    class Mine(sblcosim.Receiver):
        def update(self, samples: Any) -> sblcosim.Estimate:
            here.append(os.getpid())
            return sblcosim.Estimate(samples[-1].epoch, (1.0, 2.0, 3.0))

    sblcosim.run(SCENARIO, Mine, SHORT)
    assert set(here) == {os.getpid()}


@pytest.mark.parametrize("master", ["python", "native", "lanes"])
def test_beside_a_class_of_this_process(master: str, tmp_path: Path) -> None:
    class Here(sblcosim.Receiver):
        def update(self, samples: Any) -> sblcosim.Estimate:
            return sblcosim.Estimate(samples[-1].epoch, (3.0, 2.0, 1.0))

    file = str(written(tmp_path, "nowhere", NOTHING))
    keys = {**SHORT, "receiver.interval_s": 0.05}
    result = sblcosim.run(SCENARIO, [file, Here, "ekf"], keys, master=master)
    alone = sblcosim.run(SCENARIO, [Here, "ekf"], keys, master=master)
    same(result, alone, ("target", "platform", "acoustics", "Here", "ekf", "raw"))
    assert result.record.values["Mine.position"][-1].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("place", ["platform", "nowhere"])
def test_a_component_from_a_file_on_which_others_depend(place: str, tmp_path: Path) -> None:
    (tmp_path / "still.py").write_text(
        "import os\nimport numpy as np\nfrom sblcosim.models import declared\n"
        "class Still:\n    variables = tuple(\n"
        "        v for v in declared('target') if v.causality == 'output')\n"
        "    def initialise(self, start_ns, parameters):\n"
        "        return {v.name: np.zeros(v.shape) for v in self.variables}\n"
        "    def do_step(self, time_ns, step_ns, inputs):\n"
        f"        {'os._exit(0)' if place == 'platform' else 'pass'}\n"
        "        return {v.name: np.zeros(v.shape) for v in self.variables}\n"
    )
    parts = {"target": known_source(f"{tmp_path}/still.py:Still")}
    if place == "nowhere":
        result = sblcosim.run(SCENARIO, "ekf", SHORT, components=parts)
        assert (result.record.values["target.position"] == 0.0).all()
        return
    with pytest.raises(SblcosimError) as caught:
        sblcosim.run(SCENARIO, "ekf", SHORT, components=parts)
    message = one_line(str(caught.value))
    assert message.startswith("target: the Python component still.py:Still ended the process (exit")
    assert " in do_step at 0 s" in message


ADDS = """
import os, sys
from pathlib import Path
import sblcosim
sys.path.insert(0, str(Path(__file__).parent / "lib"))
sys.path.append(str(Path(__file__).parent / "more"))
os.environ["OF_THE_FILE"] = "2.0"

class Mine(sblcosim.Receiver):
    def start(self):
        import imported_later
        self.place = imported_later.PLACE
    def update(self, samples):
        import much_later
        place = float(os.environ["OF_THE_FILE"]), *self.place, much_later.PLACE
        return sblcosim.Estimate(samples[-1].epoch, place)
"""


def test_what_a_file_adds_for_itself_is_there_when_it_runs(tmp_path: Path) -> None:
    modules = {"lib/imported_later": "PLACE = (3.0,)", "more/much_later": "PLACE = 4.0"}
    for name, text in modules.items():
        file = tmp_path / f"{name}.py"
        file.parent.mkdir()
        file.write_text(text)
    (tmp_path / "mine.py").write_text(ADDS)
    path = [*sys.path]
    for _ in range(2):
        result = sblcosim.run(SCENARIO, str(tmp_path / "mine.py"), SHORT)
        assert (result.record.values["Mine.position"][-1] == (2.0, 3.0, 4.0)).all()
    assert sys.path == path
    assert "OF_THE_FILE" not in os.environ


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other limits")
@pytest.mark.parametrize("limit", ["RLIMIT_AS, (10**6, 10**6)", "RLIMIT_FSIZE, (0, 0)"])
def test_a_limit_that_a_file_sets_is_its_own_fault(
    limit: str, tmp_path: Path, alone: sblcosim.Result
) -> None:
    text = f"import resource; resource.setrlimit(resource.{limit})"
    file = written(tmp_path, "import", text)
    result: sblcosim.Result | str
    try:
        result = sblcosim.run(SCENARIO, ["ekf", str(file)], SHORT)
    except ConfigurationError as error:
        result = str(error)
    if isinstance(result, str):  # too little was left for the import, or for the task after it
        assert re.search(r"must be importable( there)?, got MemoryError", one_line(result)), result
        return
    same(result, alone, ("target", "platform", "acoustics", "ekf", "raw"))
    assert one_line(result.failures["Mine"]).startswith("Mine: must let its process go on, got ")


# ---- the command ----


def test_modules_of_the_working_directory_are_not_ours(tmp_path: Path) -> None:
    for name in ("json", "numpy", "sblcosim", "pickle"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(3)")
    file = written(tmp_path, "nowhere", NOTHING)
    words = ("--set", "time.duration_s=2", "--no-figures", "--out", "out")
    script = Path(sys.executable).with_name("sblcosim")
    done = subprocess.run(
        [script, "run", SCENARIO, "--receiver", file.name, *words],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_command_ends_with_a_line_and_a_code(tmp_path: Path) -> None:
    """The results of the others are written; without others nothing is."""
    file = written(tmp_path, "do_step", "import os; os._exit(0)")
    words = ("--set", "time.duration_s=2", "--no-figures", "--force", "--out", tmp_path / "out")
    done = command("run", SCENARIO, "--receiver", "ekf", "--receiver", file, *words, "--json")
    assert done.returncode == 1
    printed = json.loads(done.stdout)
    assert set(printed["errors"]) == {"ekf", "raw"}
    (message,) = printed["failures"].values()
    assert message.startswith("Mine: the Python component mine.py:Mine ended the process (exit")
    assert f"error: {message}\n" in done.stderr
    done = CliRunner().invoke(app, ["run", SCENARIO, "--receiver", str(file), *map(str, words)])
    assert done.exit_code == 2
    assert one_line(done.stderr).startswith("error: Mine: the Python component")
    file = written(tmp_path, "import", "import os; os._exit(0)")
    done = CliRunner().invoke(app, ["run", SCENARIO, "--receiver", str(file), *map(str, words)])
    assert done.exit_code == 2
    assert one_line(done.stderr).endswith("ended the process (exit code 0) in its import\n")


def test_results_go_where_the_command_was_told_and_prints_stay_out(tmp_path: Path) -> None:
    text = "import os, sys; os.chdir('/'); print('from the receiver'); sys.stdout.close()"
    file = written(tmp_path, "import", text)
    words = ("--set", "time.duration_s=2", "--out", "out", "--no-figures", "--json")
    done = command("run", SCENARIO, "--receiver", file, *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Mine" in json.loads(done.stdout)["errors"]
    assert (tmp_path / "out" / "manifest.json").exists()
    assert "from the receiver" in done.stderr


@pytest.mark.usefixtures("only_hangs_take_time")
@pytest.mark.parametrize(
    "words",
    [
        ("run", SCENARIO, "--receiver", "mine.py", "--set", "time.duration_s=2"),
        ("compare", SCENARIO, "--receiver", "ekf", "--receiver", "mine.py", "--runs", 2),
        ("study", "mine.toml"),
    ],
)
def test_a_file_that_never_ends_is_given_up_by_every_command(
    words: tuple[object, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path, "import", LOOP)
    (tmp_path / "mine.toml").write_text(
        f'scenario = "{SCENARIO}"\nreceivers = ["ekf"]\nresponses = ["mine.py:response"]\n'
        "[design]\nkind = 'single'\n"
    )
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [*map(str, words), "--step-timeout", "0.5", "--out", "out"])
    assert done.exit_code == 2
    assert "has not returned from its import for 0.5 s" in one_line(done.stderr)


# ---- studies ----


@pytest.mark.parametrize("executor", few(["threads", "processes"], quick=["threads"]))
def test_a_study_keeps_the_healthy_receivers_columns(executor: str, tmp_path: Path) -> None:
    file = written(tmp_path, "do_step", "import os; os._exit(0)")
    tables = {"scenario": SCENARIO, "fixed": SHORT, "design": {"kind": "single"}, "replicates": 2}
    made = study.load({**tables, "receivers": ["ekf", str(file)]})
    table = made.run(tmp_path / "out", executor=executor, workers=1)
    own = study.load({**tables, "receivers": ["ekf"]}).run(tmp_path / "own")
    for column in own.columns[own.columns.str.startswith("ekf.")]:
        assert table[column].equals(own[column]), column
    for message in table["error"]:
        assert message.startswith("Mine: the Python component mine.py:Mine ended the process (")


def test_a_study_keeps_its_children_and_leaves_one(
    started: list[child_process.Process], tmp_path: Path
) -> None:
    file = written(tmp_path, "nowhere", NOTHING)
    made = study.load({
        "scenario": SCENARIO, "fixed": SHORT, "design": {"kind": "single"}, "replicates": 6,
        "receivers": [str(file)], "responses": [f"{file}:response"],
    })  # fmt: skip
    table = made.run(tmp_path / "out", workers=2)
    assert table["error"].isna().all()
    assert (table["Mine.response"] == 1.0).all()
    assert len(started) <= 2
    assert sum(child.alive for child in started) == 1


def test_what_cannot_be_sent_elsewhere_runs_here(tmp_path: Path) -> None:
    file = written(tmp_path, "nowhere", NOTHING)
    text = file.read_text().replace("DONE = False", "import threading\nLOCK = threading.Lock()")
    file.write_text(text.replace('deed("do_step")', "LOCK.acquire(); LOCK.release()"))
    tables = {"scenario": SCENARIO, "fixed": SHORT, "design": {"kind": "single"}}
    made = study.load({**tables, "receivers": [str(file)]})
    assert made.run(tmp_path / "out", workers=1)["error"].isna().all()
    with pytest.raises(ConfigurationError) as caught:
        made.run(tmp_path / "other", executor="processes", workers=1)
    words = "mine.py:Mine must be something that other processes can receive, got TypeError"
    assert words in one_line(str(caught.value))


def test_a_kept_child_is_not_one_of_a_forked_process(
    started: list[child_process.Process], tmp_path: Path
) -> None:
    file, keys = str(written(tmp_path, "nowhere", NOTHING)), []
    take = type(waiting).take

    def noted(self: Any, key: str) -> Any:
        keys.append(key)
        return take(self, key)

    with Seam() as seam:
        seam.instead(take, noted)
        sblcosim.run(SCENARIO, file, SHORT)
    assert keys
    if (forked := os.fork()) == 0:
        code = 1
        try:
            code = 2 if any(map(children.waiting.take, keys)) else 0
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(forked, 0)[1]) == 0
    sblcosim.run(SCENARIO, file, SHORT)
    assert len(started) == 1


def test_exit_handlers_of_a_file_are_run(
    tmp_path: Path, seam: Seam
) -> None:
    seam.tuned(farewell=300.0)
    text = f"import atexit; atexit.register(lambda: open({str(tmp_path / 'end')!r}, 'w').close())"
    sblcosim.run(SCENARIO, str(written(tmp_path, "import", text)), SHORT)
    assert not (tmp_path / "end").exists()
    waiting.close()
    assert (tmp_path / "end").exists()


def test_nothing_stays_of_a_program_that_has_ended(tmp_path: Path) -> None:
    file = written(tmp_path, "import", f"import os; open({str(tmp_path / 'pid')!r}, 'w').write("
                                       "str(os.getpid()))")  # fmt: skip
    code = f"import sblcosim; sblcosim.run({SCENARIO!r}, {str(file)!r}, {SHORT!r})"
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_an_interrupted_call_ends_its_child(
    started: list[child_process.Process], tmp_path: Path
) -> None:
    deed = "import os, signal, time; os.kill(os.getppid(), signal.SIGINT); time.sleep(600)"
    file = written(tmp_path, "constructor", deed)
    with pytest.raises(KeyboardInterrupt):
        sblcosim.run(SCENARIO, str(file), SHORT)
    assert [child.alive for child in started] == [False]


def test_what_it_is_given_by_value_is_what_its_file_says(tmp_path: Path) -> None:
    file = written(tmp_path, "nowhere", NOTHING)
    source = known_source(str(file))
    sent = for_others(source.maker)  # type: ignore[union-attr, arg-type]
    assert sent.content is None
    assert b"Estimate" in (sent.packed or b"")


def test_what_a_file_declares_brings_no_code_of_its_own_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "only_there.py").write_text("class Odd(float):\n    pass\n")
    (tmp_path / "mine.py").write_text(
        "import only_there\nimport sblcosim\nfrom dataclasses import replace\n"
        "class Mine(sblcosim.Receiver):\n    @property\n    def variables(self):\n"
        "        first, *rest = super().variables\n"
        "        return (replace(first, start=only_there.Odd(0.1)), *rest)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigurationError) as caught:
        sblcosim.run(SCENARIO, str(tmp_path / "mine.py"), SHORT)
    assert "must be plain values, got an instance of only_there.Odd" in one_line(str(caught.value))
    assert "only_there" not in sys.modules
