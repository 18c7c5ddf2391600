"""What a child process is doing, in words: whose call failed, which one, and when."""

from __future__ import annotations

import mmap
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sblcosim.fmus.host.instances import LOADING, UNLOADING
from sblcosim.fmus.host.nanoseconds import text_of
from sblcosim.fmus.read.ports import Fmu

from ...errors import ConfigurationWarning, FmuError
from ..plans.plan import PlannedComponent
from .messages import Begun, TaskEnded
from .state import CALLING, LOOP, State

_PHRASES = {LOADING: "loading its library", UNLOADING: "unloading its library"}
_HABITS = {1: "the floating-point state of the processor", 2: "the locale"}


def who(component: PlannedComponent) -> str:
    """Description of a component for messages."""
    if isinstance(component.source, Fmu):
        return f"FMU {component.source.path}"
    return f"the Python component {component.origin}"


@dataclass
class Watched:
    """The current task, with the data needed to name a failing component.

    Attributes
    ----------
    names
        Description of each component, by name, in the order of the task.
    suspects
        Components that may end the process.
    cases
        Subject of each of many calls, by the row of the progress.
    """

    names: Mapping[str, str]
    suspects: tuple[str, ...]
    instants: Sequence[int] = ()
    begun: Begun | None = None
    parts: Sequence[mmap.mmap] = ()
    """Mapped parts of the record. Windows frees them with their last user, so they stay here."""
    cases: Sequence[str] = ()

    def failure(self, s: State, seconds: float | None, what: str = "") -> FmuError:
        """The exception for a process that has ended, or has made no progress for some seconds."""
        name, function, when = self._place(s)
        suspects = self.suspects
        sure = name in suspects
        if not sure and seconds is None:
            name = suspects[0] if len(suspects) == 1 else None
        if name is None:
            if seconds is not None:
                what = f"made no progress for {seconds:g} s"
            error = FmuError(
                f"{', '.join(suspects) or 'the process for third-party FMUs'}: one of these has "
                f"{what}{when}"
            )
        else:
            if seconds is not None:
                what = f"has not returned from {function}{when} for {seconds:g} s"
            elif sure:
                what = f"{what} in {function}{when}"
            else:
                what = f"{what} outside its calls, perhaps in a thread{when}"
            said = ""
            if s.saying >= 0 and list(self.names)[s.saying : s.saying + 1] == [name]:
                said = s.said.decode(errors="replace").removeprefix(f"{name}: ")
            error = FmuError(f"{name}: {self.names[name]} {what}" + (f": {said}" if said else ""))
            error.component = name
        if seconds is None and len(suspects) > 1:
            error.suspects = suspects
        return error

    def _place(self, s: State) -> tuple[str | None, str, str]:
        """Component and function of the current call, and its time as text."""
        if s.where == LOOP:
            when = f" at {text_of(self.instants[s.progress.row])}"
            if self.begun is None:
                return None, "", when
            return *self.begun.labels[s.progress.at], when
        names = list(self.names)
        if s.where != CALLING or not 0 <= s.component < len(names):
            return None, "", ""
        function = s.function.decode()
        case = self.cases[s.progress.row] if s.progress.row < len(self.cases) else ""
        return names[s.component], _PHRASES.get(function, function), case and f" at {case}"

    def tell(self, answer: TaskEnded) -> None:
        """Warn about what a task has changed, and pass on the warnings of the user's code."""
        for name, function, habits in answer.habits:
            what = " and ".join(text for bit, text in _HABITS.items() if habits & bit)
            warnings.warn(
                f"{name}: {self.names[name]} must leave {what} unchanged, got a change in "
                f"{_PHRASES.get(function, function)}; it was undone",
                ConfigurationWarning,
                4,
            )
        for text, category, file, line in answer.warned:
            warnings.warn_explicit(text, category, file, line)
