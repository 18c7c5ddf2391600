"""The flag of Ctrl-C and SIGTERM: nothing that Python discards is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest
import sblcosim
from sblcosim.fmus import files, stopping

pytestmark = pytest.mark.skipif(os.name == "nt", reason="there is no SIGTERM")
PATIENCE = 120.0
"""For what takes a quarter of a second [s]."""


def interrupt(number: int = signal.SIGINT) -> None:
    os.kill(os.getpid(), number)


def busy(seconds: float) -> None:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        pass


class Finalised:
    """Is busy where Python discards exceptions."""

    def __del__(self) -> None:
        interrupt()
        busy(3 * stopping.GRACE)


def in_del() -> None:
    Finalised()


def in_weakref() -> None:
    thing = Finalised.__new__(type("Thing", (), {}))
    reference = weakref.ref(thing, lambda _: (interrupt(), busy(3 * stopping.GRACE)))
    del thing
    assert reference() is None


def in_ctypes() -> None:
    import ctypes

    def called() -> None:
        interrupt()
        busy(3 * stopping.GRACE)

    ctypes.CFUNCTYPE(None)(called)()


def in_user_code() -> None:
    interrupt()
    with suppress(BaseException):
        busy(PATIENCE)


DISCARDED = [in_del, in_weakref, in_ctypes, in_user_code]


@pytest.mark.parametrize("discard", DISCARDED)
def test_what_is_discarded_is_raised_by_the_next_check(
    discard: Callable[[], None], capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        discard()
        stopping.check()
        raise AssertionError("the check must raise")
    assert "Exception ignored" not in capfd.readouterr().err


@pytest.mark.parametrize("discard", DISCARDED)
def test_or_before_a_file_gets_its_name_or_at_the_end(
    discard: Callable[[], None], tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        discard()
        files.write_file(tmp_path / "result", b"content")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():
        discard()


def test_without_a_check_the_handler_raises() -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        interrupt()
        threading.Event().wait(PATIENCE)
    assert time.monotonic() - began < PATIENCE


def test_handlers_are_restored_and_those_of_others_left_alone() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    hook = sys.unraisablehook
    with stopping.stoppable():
        assert signal.getsignal(signal.SIGINT) != before[0]
        assert signal.getsignal(signal.SIGTERM) == before[1]
        with stopping.stoppable():
            pass
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    assert sys.unraisablehook is hook

    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        with stopping.stoppable():
            interrupt()
            stopping.check()
    finally:
        signal.signal(signal.SIGINT, before[0])
    assert came == [signal.SIGINT]


def test_in_another_thread_nothing_changes() -> None:
    before = signal.getsignal(signal.SIGINT)

    def inside() -> bool:
        with stopping.stoppable():
            return signal.getsignal(signal.SIGINT) is before

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(inside).result()


def test_cleaning_up_is_not_interrupted() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        try:
            interrupt()
            stopping.check()
        finally:
            stopping.check()
            busy(3 * stopping.GRACE)
            done.append(True)
    assert done


def test_an_error_after_the_signal_is_its_consequence() -> None:
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        interrupt()
        raise AttributeError("partially initialised")


def test_a_program_that_is_waited_for_is_killed_with_what_it_started(tmp_path: Path) -> None:
    script = f"import subprocess; subprocess.run(['sh', '-c', 'sleep 1000; touch {tmp_path}/a'])"
    with pytest.raises(KeyboardInterrupt), stopping.stoppable():  # noqa: PT012
        threading.Timer(0.3, interrupt).start()
        stopping.completed([sys.executable, "-c", script])


@pytest.mark.parametrize("master", ["native", "python", "lanes"])
def test_ctrl_c_ends_a_run_in_a_program_or_notebook(master: str) -> None:
    long = {"time.duration_s": 20000.0, "time.sampling_time_s": 0.01}
    before = signal.getsignal(signal.SIGINT)
    timer = threading.Timer(0.5, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        sblcosim.run("paper-scenario-1", overrides=long, master=master)
    timer.join()
    assert signal.getsignal(signal.SIGINT) is before


SECOND = """
import os, signal, time
from sblcosim.fmus import stopping
with stopping.stoppable(command=True):
    os.kill(os.getpid(), signal.SIGTERM)
    os.kill(os.getpid(), signal.SIGTERM)  # as `timeout` does
    time.sleep(2 * stopping.PERIOD)
    with stopping.deferred():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1000)
"""


def test_a_second_ctrl_c_ends_the_command_at_once() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SECOND], capture_output=True, text=True, timeout=PATIENCE,
        check=False,
    )  # fmt: skip
    assert done.returncode == 130
    assert "at once" in done.stderr


LATE = """
import os, signal, time
from sblcosim.fmus import stopping

kill = signal.pthread_kill

def late(*arguments):
    time.sleep(0.4)
    kill(*arguments)

signal.pthread_kill = late
try:
    with stopping.stoppable(command=True):
        os.kill(os.getpid(), signal.NUMBER)
        since = time.monotonic()
        while time.monotonic() < since + stopping.GRACE + 0.2:
            time.sleep(0.01)
        stopping.check()
except KeyboardInterrupt:
    print("stopped", flush=True)
time.sleep(0.6)
print("lives")
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_no_nudge_comes_after_the_block(number: str) -> None:
    """It would come to the handlers of before, and end the process as the signal does."""
    code = LATE.replace("NUMBER", number)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "stopped\nlives\n"), done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_does_not_interrupt_the_wait_for_what_is_typed_ends_it(number: int) -> None:
    """It reaches another thread, as one that comes just before the wait: no handler is run."""
    code = (
        "import os, signal, sys, threading\n"
        "from sblcosim.fmus import stopping\n"
        "number, begun = int(sys.argv[1]), threading.Event()\n"
        "def aside():\n"
        "    begun.wait()\n"
        "    signal.pthread_kill(threading.get_ident(), number)\n"
        "with stopping.stoppable(command=True):\n"
        "    for _ in range(3):\n"
        "        with stopping.prompting():\n"
        "            assert os.read(0, 1) == b'x'\n"
        "    assert signal.set_wakeup_fd(-1) == -1\n"
        "    threading.Thread(target=aside).start()\n"
        "    print('reads', flush=True)\n"
        "    with stopping.prompting():\n"
        "        begun.set()\n"
        "        os.read(0, 1)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(int(number))], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        process.stdin.write("xxx")
        process.stdin.flush()
        assert process.wait(PATIENCE) != 0
        assert process.stdout is not None
        assert process.stdout.read() == "reads\n"
        assert process.stderr is not None
        last = process.stderr.read().splitlines()[-1]
    kind = {signal.SIGINT: "KeyboardInterrupt", signal.SIGTERM: "sblcosim.fmus.stopping.Terminated"}
    assert last == kind[number]  # type: ignore[index]
