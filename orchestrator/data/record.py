"""Record: all outputs of all components during a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND
from sblcosim.models.ports import REQUIRED_ESTIMATE

from ..errors import ConfigurationError, nearest
from ..shown import Shown
from .estimates import Estimates, Flags, Floats, Integers

if TYPE_CHECKING:
    import pandas as pd

NEVER = np.iinfo(np.int64).min
"""Marks an epoch that is not a valid time [ns]."""
_MOST_SECONDS = 9e9  # largest time that fits into int64 nanoseconds


@dataclass(frozen=True, eq=False, repr=False)
class Record(Shown):
    """All outputs of all components at all communication instants.

    Attributes
    ----------
    time_ns
        Communication instants [ns], including the start; shape (n,).
    values
        By ``"component.variable"``, in SI units; shape (n, …). At an instant that is not the
        component's own, outputs are those of its previous own instant.
    intervals_ns
        Communication intervals [ns], by component. All instants belong to a component that is not
        listed.
    failures
        Messages of failures after the last instant, by component.
    """

    time_ns: Integers
    values: Mapping[str, NDArray[np.generic]]
    intervals_ns: Mapping[str, int] = field(default_factory=dict)
    failures: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_ns)

    def _gist(self) -> str:
        owners = ", ".join(dict.fromkeys(name.partition(".")[0] for name in self.values))
        start, stop = (self.time_ns[i] / SECOND for i in (0, -1))
        return f"of {len(self)} instants, {start:g} to {stop:g} s: {owners}"

    def own(self, component: str) -> Flags:
        """Mask of the component's own instants; shape (n,)."""
        interval = self.intervals_ns.get(component, 1)
        own: Flags = (self.time_ns - self.time_ns[0]) % interval == 0
        return own

    def valid(self, component: str) -> Flags:
        """Whether a receiver has an estimate: ``valid``, else a positive update count; (n,)."""
        if f"{component}.valid" in self.values:
            return self.values[f"{component}.valid"].astype(bool)
        return self.values[f"{component}.update_count"].astype(np.int64) > 0

    def to_frame(self) -> pd.DataFrame:
        """One row per instant: ``time_s`` [s], then ``component.variable[i,j]``, 1-based."""
        return frame_of({"time_s": self.time_ns / SECOND, **self.values})

    def estimates(self, component: str) -> Estimates:
        """The estimates of a receiver: one for each change of ``update_count``.

        Rows that the receiver marks as not ``valid`` are left out.

        Raises
        ------
        ConfigurationError
            The component is unknown or lacks a port that every receiver has.
        """
        known = {name.partition(".")[0] for name in self.values}
        if component not in known:
            raise ConfigurationError(
                f"{component}: must be a component of the record{nearest(component, known)}"
            )
        ports = {
            variable: values
            for name, values in self.values.items()
            for owner, _, variable in (name.partition("."),)
            if owner == component
        }
        missing = [name for name in REQUIRED_ESTIMATE if name not in ports]
        if missing:
            raise ConfigurationError(
                f"{component}: must be a receiver, got no output {' and no '.join(missing)}"
            )
        count = ports["update_count"].astype(np.int64)
        new = np.diff(count, prepend=0) != 0
        valid = self.valid(component)
        new &= valid
        ends = np.append(np.flatnonzero(new | ~valid), len(self) - 1)
        until = ends[np.searchsorted(ends[:-1], np.flatnonzero(new), side="right")]

        def at(name: str) -> Floats | None:
            return ports[name][new].astype(np.float64) if name in ports else None

        degrees = ports.get("nis_degrees")
        return Estimates(
            epoch_ns=epochs_ns(self.time_ns, ports["epoch"][new].astype(np.float64)),
            available_ns=self.time_ns[new],
            until_ns=self.time_ns[until],
            update_count=count[new],
            position=ports["position"][new].astype(np.float64),
            velocity=at("velocity"),
            position_std=at("position_std"),
            covariance=at("covariance"),
            nis=at("nis"),
            nis_degrees=None if degrees is None else degrees[new].astype(np.int64),
            relative_position=at("relative_position"),
            relative_covariance=at("relative_covariance"),
        )


def frame_of(values: Mapping[str, NDArray[np.generic]]) -> pd.DataFrame:
    """Arrays of shape (n, …) as a table: one column per element, ``name[i,j]``, 1-based."""
    import pandas as pd

    columns: dict[str, NDArray[np.generic]] = {}
    for name, array in values.items():
        for index in np.ndindex(array.shape[1:]):
            element = ",".join(str(i + 1) for i in index)
            columns[f"{name}[{element}]" if index else name] = array[:, *index]
    return pd.DataFrame(columns)


def epochs_ns(time_ns: Integers, epoch_s: Floats) -> Integers:
    """Convert epochs to nanoseconds, matched to the recorded instants.

    Parameters
    ----------
    time_ns
        Recorded instants [ns], increasing; shape (n,).
    epoch_s
        Epochs [s]; shape (m,).

    Returns
    -------
    epoch_ns
        Epochs [ns]; shape (m,); `NEVER` where the input is not a valid time.
    """
    some = np.abs(epoch_s) < _MOST_SECONDS
    rest, whole = np.modf(np.where(some, epoch_s, 0.0))
    nearest = whole.astype(np.int64) * SECOND + np.rint(rest * 1e9).astype(np.int64)
    # After 97 days, a double in seconds no longer identifies the nanosecond.
    seconds = time_ns / 1e9
    at = np.minimum(np.searchsorted(seconds, epoch_s), len(seconds) - 1)
    return np.where(some, np.where(seconds[at] == epoch_s, time_ns[at], nearest), NEVER)
