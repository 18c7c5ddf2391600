"""Executors for the runs of a campaign: local threads, local processes, or a Dask cluster.

Threads share the campaign. Other processes receive it as a parcel with its FMU files, so they need
neither compiler nor CasADi nor a shared file system.
"""

from __future__ import annotations

import hashlib
import io
import logging
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pandas as pd
from sblcosim.fmus import stopping
from sblcosim.fmus.build.factory import cache
from sblcosim.fmus.files import leave, sha256_of, sweep, write_file
from sblcosim.fmus.host.libraries import ours, trust
from sblcosim.fmus.read.ports import Fmu

from ..errors import ConfigurationError, SblcosimError, check_choice, one_line
from ..simulation.children.children import Children
from ..simulation.code.user_code import InFile
from ..simulation.how import HOW, How
from ..simulation.user.files import for_others
from .batch import simulate
from .campaign import Campaign, CampaignRun

EXECUTORS = ("threads", "processes")
"""Names of the executors on this machine."""
PATIENCE = 5
"""Time limit for a scheduler to answer [s]."""

Done = Callable[[Sequence[CampaignRun], float], None]
"""Called with some runs and the completed share of them, 0 to 1."""
Simulated = Iterator[tuple[Sequence[CampaignRun], pd.DataFrame]]
"""Parts of a campaign and their tables, in order."""


Simulate = Callable[[Iterable[Sequence[CampaignRun]], Done], Simulated]
"""Simulates parts of a campaign."""


@contextmanager
def ready(campaign: Campaign, how: How = HOW) -> Iterator[Simulate]:
    """Find or start the workers for a campaign; release them at the end.

    Raises
    ------
    ConfigurationError
        The executor or scheduler does not exist or has no workers. While simulating: the workers
        have ended too early.
    """
    executor, scheduler, master = how.executor, how.scheduler, how.master
    if not isinstance(executor, Executor):
        check_choice("executor", executor, EXECUTORS)
    if scheduler is not None and executor != "threads":
        raise ConfigurationError(f"executor: must not be given with a scheduler, got {executor!r}")
    number = how.workers or getattr(executor, "_max_workers", None) or os.cpu_count() or 1
    if scheduler is not None:
        with _cluster(scheduler) as client:
            # As a task, the parcel stays with the workers, and is computed again if they are lost.
            parcel = client.submit(_same, pack(campaign), pure=False)
            number = sum(client.nthreads().values())
            yield partial(_spread, client.get_executor(pure=False), parcel, number, master)
    elif executor == "threads":
        with Children(patience_s=campaign.step_timeout) as children:
            yield partial(_here, campaign, how, children)
    elif isinstance(executor, Executor):
        yield partial(_spread, executor, pack(campaign), number, master)
    else:
        with processes(number) as pool:
            yield partial(_spread, pool, pack(campaign), number, master, ours=True)


def _here(
    campaign: Campaign,
    how: How,
    children: Children,
    parts: Iterable[Sequence[CampaignRun]],
    done: Done,
) -> Simulated:
    for part in parts:
        own = replace(how, progress=partial(done, part))
        yield part, simulate(campaign, part, own, children)


# --- Other processes -----------------------------------------------------------------------------


def _spread(
    pool: Executor,
    parcel: Any,
    workers: int,
    master: str | None,
    parts: Iterable[Sequence[CampaignRun]],
    done: Done,
    *,
    ours: bool = False,
) -> Simulated:
    """Distribute the runs of a part, and those of the next parts while some workers are idle.

    ``ours``: the pool ends with the runs, together with anything it has not begun.
    """
    pending: deque[tuple[Sequence[CampaignRun], list[Future[pd.DataFrame]]]] = deque()
    rest = iter(parts)
    try:
        while True:
            while sum(len(futures) for _, futures in pending) < 2 * workers:
                part = next(rest, None)
                if part is None:
                    break
                size = -(-len(part) // (2 * workers))
                try:
                    with deferring_signals():  # this may start a process
                        futures = [
                            pool.submit(_work, parcel, part[i : i + size], master)
                            for i in range(0, len(part), size)
                        ]
                except BrokenExecutor:
                    raise ConfigurationError(_ENDED) from None
                pending.append((part, futures))
            if not pending:
                return
            part, futures = pending[0]
            tables = []
            for future in futures:
                tables.append(_result(future))
                done(part, len(tables) / len(futures))
            pending.popleft()
            yield part, pd.concat(tables, ignore_index=True)
    finally:
        for _, futures in () if ours else pending:
            for future in futures:
                future.cancel()


_ENDED = (
    "workers: must live until their runs are done, got one that ended (a crash of an FMU, or too "
    "little memory); finished runs are kept, and the same command continues with them"
)


def _result(future: Future[pd.DataFrame]) -> pd.DataFrame:
    try:
        return stopping.result(future)
    except SblcosimError:
        raise
    except CancelledError:
        raise ConfigurationError(
            "scheduler: must stay until all runs are done, got none any more; finished runs are "
            "kept, and the same command continues with them"
        ) from None
    except BrokenExecutor:
        time.sleep(stopping.PERIOD)  # whoever ends the workers may mean this process too
        stopping.check()
        raise ConfigurationError(_ENDED) from None
    except Exception as error:
        raise ConfigurationError(
            f"workers: must be able to simulate, got {type(error).__name__}: {one_line(error)}; "
            "finished runs are kept, and the same command continues with them"
        ) from error


@contextmanager
def processes(workers: int) -> Iterator[Executor]:
    """Processes of this machine that end when the body of the statement is stopped."""
    context = multiprocessing.get_context("spawn")
    # Its end tells them. An Event would wait forever for a killed worker.
    told, telling = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, context, begin, (told,))
    try:
        yield pool
    except BaseException:
        telling.close()
        started = [*(pool._processes or {}).values()]
        manager: Any = pool._executor_manager_thread
        pool.shutdown(wait=False, cancel_futures=True)  # otherwise killed workers keep runs
        _end(started)
        if manager is not None:  # it must not meet the end of the interpreter
            manager.join(_MANAGER_S)
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        telling.close()
        told.close()


_MANAGER_S = 10.0
"""Seconds for the thread of a pool to notice that its workers have ended; usually few."""
_KILLED_S = 10.0
"""Seconds for a killed process to end and release its locks; it takes milliseconds."""


def _end(workers: Sequence[BaseProcess]) -> None:
    """Kill the workers that do not end on request, because they are busy or not ready yet.

    The files left by them, and by workers that somebody else has killed, are removed here.
    """
    until = time.monotonic() + 2 * stopping.GRACE
    for process in workers:
        process.join(max(until - time.monotonic(), 0))
        process.kill()
    for process in workers:
        process.join(_KILLED_S)
    sweep(Path(tempfile.gettempdir()))


@contextmanager
def deferring_signals() -> Iterator[None]:
    """Start processes that ignore signals to stop; this process handles them after the block."""
    with stopping.deferred(), _blocked_in_children():
        yield


@contextmanager
def _blocked_in_children() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # if it started inside the block, it would unblock SIGINT
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def begin(told: Connection | None = None) -> None:
    """Initialise a worker: it ends on request or with the parent process, however that ends.

    Signals to stop, which a whole group of processes may receive, are for the parent.

    Parameters
    ----------
    told
        When it ends, the worker's task must end: at the next check, or with the worker.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: None)  # not inherited by the worker's processes
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    def obey(told: Connection) -> None:
        with suppress(EOFError, OSError):
            told.recv_bytes()
        stopping.tell()
        time.sleep(stopping.GRACE)
        leave()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    if told is not None:
        threading.Thread(target=obey, args=(told,), daemon=True).start()


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    """A client of a Dask cluster that has workers."""
    try:
        import distributed
        from distributed.comm.addressing import resolve_address
    except ImportError:
        raise ConfigurationError(
            "scheduler: must have dask.distributed here, got none; install sblcosim[cluster]"
        ) from None
    try:
        resolve_address(address)
        client: Any = distributed.Client(address, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        raise ConfigurationError(
            f"scheduler: must be the address of a Dask scheduler that answers, got {address!r} "
            f"({one_line(error)})"
        ) from None
    with _quiet("distributed"), client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ConfigurationError(
                f"scheduler: must have workers, got none at {address}"
            ) from None
        yield client


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Silence the logs of a library that reports errors by exceptions."""
    logs = [logging.getLogger(n) for n in logging.root.manager.loggerDict if n.startswith(name)]
    before = [log.disabled for log in logs]
    for log in logs:
        log.disabled = True
    try:
        yield
    finally:
        for log, disabled in zip(logs, before, strict=True):
            log.disabled = disabled


# --- Parcels -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Parcel:
    """A campaign packed for other processes.

    Attributes
    ----------
    content
        The pickled campaign, with SHA-256 values in place of FMU files.
    fmus
        Names and contents of the FMU files, by SHA-256.
    ours
        SHA-256 values of the FMUs that this project has built.
    version
        Version of sblcosim that packed it.
    """

    content: bytes
    fmus: Mapping[str, tuple[str, bytes]]
    ours: tuple[str, ...]
    version: str


def _proxy(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)


class _Packer(pickle.Pickler):
    """Replaces paths of FMU files by their SHA-256 values, and Python files by their content."""

    def __init__(self, stream: io.BytesIO, known: Mapping[Path, str]) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self.known = known

    def persistent_id(self, thing: Any) -> str | None:
        return self.known.get(thing) if isinstance(thing, Path) else None

    def reducer_override(self, thing: Any) -> Any:
        if isinstance(thing, MappingProxyType):
            return _proxy, (dict(thing),)
        if isinstance(thing, InFile):
            return for_others(thing).__reduce_ex__(pickle.HIGHEST_PROTOCOL)
        return NotImplemented


class _Unpacker(pickle.Unpickler):
    def __init__(self, stream: io.BytesIO, files: Mapping[str, Path]) -> None:
        super().__init__(stream)
        self.files = files

    def persistent_load(self, sha256: str) -> Path:
        return self.files[sha256]


def pack(campaign: Campaign) -> Parcel:
    """Pack a campaign and its FMUs."""
    sources = [
        component.source
        for group in campaign.groups
        for component in group.plan.components
        if isinstance(component.source, Fmu)
    ]
    known = {source.path: source.sha256 for source in sources}
    mine = {source.sha256 for source in sources if ours(source)}
    stream = io.BytesIO()
    _Packer(stream, known).dump(campaign)
    fmus = {sha256: (path.name, path.read_bytes()) for path, sha256 in known.items()}
    return Parcel(stream.getvalue(), fmus, tuple(sorted(mine)), version("sblcosim"))


_unpacked: dict[bytes, Campaign] = {}
_lock = threading.Lock()


def unpack(parcel: Parcel) -> Campaign:
    """Unpack a campaign, with its FMU files in this machine's cache; the last one is kept.

    Raises
    ------
    ConfigurationError
        The parcel is from another version of sblcosim.
    """
    here = version("sblcosim")
    if parcel.version != here:
        raise ConfigurationError(f"workers: must have sblcosim {parcel.version}, got {here}")
    key = hashlib.sha256(parcel.content).digest()
    with _lock:
        if key not in _unpacked:
            files = {}
            for sha256, (name, content) in parcel.fmus.items():
                files[sha256] = cache() / "received" / sha256 / name
                if sha256_of(files[sha256]) != sha256:
                    write_file(files[sha256], content)
            trust(parcel.ours)
            _unpacked.clear()
            _unpacked[key] = _Unpacker(io.BytesIO(parcel.content), files).load()
        return _unpacked[key]


def _same(parcel: Parcel) -> Parcel:
    """Identity, to submit a parcel as a task."""
    return parcel


def _work(parcel: Parcel, runs: Sequence[CampaignRun], master: str | None) -> pd.DataFrame:
    """Task of a worker, in one thread."""
    return simulate(unpack(parcel), runs, How(master, workers=1), _CHILDREN)


_CHILDREN = Children(idle_s=30.0)
"""Child processes of a worker, reused from task to task."""
