"""Ctrl-C and SIGTERM: a flag that all long operations read, and an exception at safe points.

An exception that a signal handler raises may land where Python discards it: in ``__del__``, in the
callback of a weak reference, or in one called from C. The handler therefore only sets a flag.
`check` raises the exception; it is called in loops and before anything gets its final name. If no
check is reached for `GRACE`, such as in an import or in a user's function, the handler raises after
all, repeatedly, until the exception arrives. Exceptions discarded meanwhile are not reported. C
code is called by another thread, or a thread that waits for it sets its flag.
"""

from __future__ import annotations

import _thread
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

PERIOD = 0.1
"""Seconds between two looks at the flag while waiting."""

GRACE = 0.25
"""Seconds that the handler waits for the next check before it raises."""

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Terminated(KeyboardInterrupt):
    """The process received SIGTERM."""


class _Stop:
    """State of a block of `stoppable`."""

    def __init__(self, command: bool) -> None:
        self.command = command
        self.came = 0  # number of the signal
        self.when = 0.0  # [s]
        self.nudged = False  # by the watchdog
        self.named: list[Path] = []
        self.over = False
        self.nudging = _thread.allocate_lock()

    def exception(self) -> KeyboardInterrupt:
        kind = Terminated if self.came == signal.SIGTERM else KeyboardInterrupt
        return kind(*map(str, self.named))


_stop: _Stop | None = None
_deferred = 0
_told = False


def wanted() -> bool:
    """Whether the process was asked to stop."""
    return _told or (_stop is not None and _stop.came != 0)


def check() -> None:
    """Raise if the process was asked to stop, unless such an exception is being handled already.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C was pressed; `Terminated` for SIGTERM.
    """
    if not wanted() or _is_handled():
        return
    raise KeyboardInterrupt if _stop is None else _stop.exception()


def _is_handled() -> bool:
    """Whether this thread is in the ``except`` or ``finally`` of a stop."""
    error: BaseException | None = sys.exception()
    seen = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__context__
    return False


def named(path: Path) -> None:
    """Remember that a result has its final name: a later stop does not undo it."""
    if _stop is not None:
        _stop.named.append(path)


def tell() -> None:
    """Set the flag in a process that another one stops; only `check` raises."""
    global _told
    _told = True


@contextmanager
def stoppable(
    *, command: bool = False, ends: tuple[type[Exception], ...] = ()
) -> Iterator[None]:
    """Let Ctrl-C end this block through the flag; the previous handlers are restored.

    Inside another such block, and outside the main thread, no handlers change. A second Ctrl-C
    raises at once. An error after the signal counts as its consequence, such as an interrupted
    import.

    Parameters
    ----------
    command
        Whether this process is ours: then SIGTERM ends the block too, and a second Ctrl-C ends the
        process with code 130. Otherwise a handler other than Python's own is left alone.
    ends
        Exceptions that are not errors.

    Raises
    ------
    KeyboardInterrupt
        As `check`; at the latest at the end of the block.
    """
    global _stop
    main = threading.current_thread() is threading.main_thread()
    usual = signal.getsignal(signal.SIGINT)
    if _stop is not None or not main or not (command or usual is signal.default_int_handler):
        with _no_consequence(ends):
            yield
        return
    stop = _stop = _Stop(command)
    before: dict[int, Any] = {}
    report, sys.unraisablehook = sys.unraisablehook, _unless_ours(sys.unraisablehook)
    try:
        numbers: list[int] = [signal.SIGINT, signal.SIGTERM]
        for number in numbers if command else numbers[:1]:
            if signal.getsignal(number) not in (signal.SIG_IGN, None):  # such as nohup, and & in sh
                before[number] = signal.signal(number, _handle)
        with _no_consequence(ends):
            yield
        check()
    finally:
        stop.over = True
        with stop.nudging:  # the last nudge comes to our handler
            pass
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = report
        _stop = None


@contextmanager
def _no_consequence(ends: tuple[type[Exception], ...]) -> Iterator[None]:
    try:
        yield
    except ends:
        raise
    except Exception as error:
        if _stop is None or not _stop.came:
            raise
        raise _stop.exception() from error


def interruptible(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """A function of the API with a `stoppable` body."""

    @functools.wraps(function)
    def stopped(*arguments: _P.args, **options: _P.kwargs) -> _R:
        with stoppable():
            return function(*arguments, **options)

    return stopped


@contextmanager
def deferred() -> Iterator[None]:
    """No handler raises inside this block of the main thread; it must be short."""
    global _deferred
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _deferred += 1
    try:
        yield
    finally:
        _deferred -= 1


@contextmanager
def prompting() -> Iterator[None]:
    """A block that waits for what is typed ends at a signal that came just before the wait, too.

    Python runs a handler when C code returns, and a wait returns for a signal within it only. So
    another thread hears of the signal, and sends it again. No other thread may be told of signals.
    """
    main = threading.main_thread()
    if _stop is None or threading.current_thread() is not main or os.name == "nt":
        yield
        return
    hears, tells = os.pipe()
    os.set_blocking(tells, False)
    before = signal.set_wakeup_fd(tells, warn_on_full_buffer=False)
    thread = threading.Thread(target=_send_again, args=(hears, main.ident), daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tells)
        thread.join()
        os.close(hears)


def _send_again(hears: int, main: int) -> None:
    while number := os.read(hears, 1):
        time.sleep(PERIOD / 2)  # a second one that soon is no second Ctrl-C
        if not wanted():
            signal.pthread_kill(main, number[0])


def _handle(number: int, frame: object) -> None:
    stop = _stop
    if stop is None or stop.over:
        return
    nudged, stop.nudged = stop.nudged, False
    if stop.came and not nudged:
        _again(stop, number)
        return
    if not stop.came:
        stop.came, stop.when = number, time.monotonic()
        # `threading` takes locks that the interrupted code may hold.
        _thread.start_new_thread(_watch, (stop, threading.main_thread().ident))
    elif not _deferred and not _is_handled():
        raise stop.exception()


def _again(stop: _Stop, number: int) -> None:
    """A second signal. Some senders send theirs twice, and SIGTERM is never urgent."""
    if number != signal.SIGINT or time.monotonic() - stop.when < PERIOD:
        return
    if stop.command:
        with suppress(OSError):
            os.write(2, b"interrupted at once; what is unfinished is removed by the next command\n")
        os._exit(128 + signal.SIGINT)
    if not _deferred:
        raise KeyboardInterrupt


def _watch(stop: _Stop, main: int | None) -> None:
    time.sleep(GRACE)
    assert main is not None
    while True:
        with stop.nudging:
            if stop.over:
                return
            stop.nudged = True
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, stop.came)  # also interrupts blocking calls
            else:
                _thread.interrupt_main(signal.Signals(stop.came))
        time.sleep(PERIOD)


def _unless_ours(report: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A hook for exceptions that Python discards; it ignores those that are raised again."""

    def hook(found: Any) -> None:
        if not (isinstance(found.exc_value, KeyboardInterrupt) and wanted()):
            report(found)

    return hook


# --- Waiting -------------------------------------------------------------------------------------


def result(future: Future[_R]) -> _R:
    """Result of a future, however long it takes.

    Raises
    ------
    KeyboardInterrupt
        As `check`.
    """
    while not wait((future,), PERIOD).done:
        check()
    return future.result()


def results(futures: Sequence[Future[_R]]) -> Iterator[_R]:
    """Results of futures, in order; those that have not begun are cancelled on an error."""
    try:
        for future in futures:
            yield result(future)
    finally:
        for future in futures:
            future.cancel()


def completed(
    command: Sequence[str], timeout: float | None = None, **options: Any
) -> subprocess.CompletedProcess[Any]:
    """As `subprocess.run`, for a long-running program; it and everything it started are killed.

    Raises
    ------
    KeyboardInterrupt
        As `check`.
    """
    group: dict[str, Any] = {} if os.name == "nt" else {"start_new_session": True}
    until = None if timeout is None else time.monotonic() + timeout
    with subprocess.Popen(command, **group, **options) as process:
        try:
            while True:
                check()
                with suppress(subprocess.TimeoutExpired):
                    out, errors = process.communicate(timeout=PERIOD)
                    return subprocess.CompletedProcess(command, process.returncode, out, errors)
                if until is not None and time.monotonic() > until:
                    raise subprocess.TimeoutExpired(command, timeout or 0.0)
        except BaseException:
            if os.name == "nt":
                process.kill()
            else:
                with suppress(OSError):
                    os.killpg(process.pid, signal.SIGKILL)
            raise
