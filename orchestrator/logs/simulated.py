"""The log of a simulated dive: what its receiver heard, measured, and where the diver was."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data import samples, truth
from ..data.estimates import Flags, Floats, Integers
from ..data.record import Record, epochs_ns
from ..errors import ConfigurationError
from .columns import KINDS
from .log import Log, Receptions
from .meta import Meta, OriginTable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..tracks.place import Origin

_PLACE, _ATTITUDE = "acoustics.ping_platform_position", "acoustics.ping_platform_attitude"
_ALL, _ARRIVAL = "acoustics.packet_beacon_position", "acoustics.arrival_epoch"


def of_record(record: Record, *, name: str, title: str = "", sound_speed: float = 1500.0,
              origin: Origin | None = None, kind: str = KINDS[0]) -> Log:
    """The log of a run, with its truth; names of beacons are 1, 2, ….

    Of several packets of a beacon between two instants, the last counts, as for a receiver.

    Parameters
    ----------
    kind
        How its ranges were measured, of `sblcosim.logs.columns.KINDS`.

    Raises
    ------
    ConfigurationError
        The record lacks outputs that every run of a scenario has.
    """
    missing = [it for it in (*samples.NEEDED, *truth.TRUTH[:2]) if it not in record.values]
    if missing:
        raise ConfigurationError(
            f"record: must be that of a scenario, to be written as a log, got no {missing[0]}"
        )
    values, time_ns = record.values, record.time_ns
    start = int(time_ns[0])
    depth_epoch = values["target.depth_epoch"].astype(np.float64)
    fresh = np.diff(depth_epoch, prepend=start / 1e9) > 0
    heard = _heard(record, KINDS.index(kind))
    known = None if origin is None else OriginTable(
        latitude_deg=origin.latitude_deg, longitude_deg=origin.longitude_deg,
        height_m=origin.height_m,
    )
    meta = Meta(
        name=name, title=title, sound_speed_m_s=sound_speed, start_ns=start,
        stop_ns=int(time_ns[-1]), origin=known, source="a simulation",
    )
    own = truth.of_record(record)
    return Log(
        name=name, meta=meta, beacons=tuple(str(i + 1) for i in range(heard.packet.shape[1])),
        receptions=heard,
        depth_ns=epochs_ns(time_ns, depth_epoch[fresh]),
        depth=values["target.depth"].astype(np.float64)[fresh],
        truth=truth.Truth(time_ns=own.time_ns, position=own.position, velocity=own.velocity),
    )


def _heard(record: Record, kind: int) -> Receptions:
    """The packets of a run, in the order of their arrival."""
    values, time_ns = record.values, record.time_ns
    count = values["acoustics.reception_count"].astype(np.int64)
    instant, beacon = np.nonzero(np.diff(count, axis=0, prepend=0 * count[:1]) > 0)

    def of_packet(output: str) -> Floats:
        found: Floats = values[output].astype(np.float64)[instant, beacon]
        return found

    posed, place, turn = _poses(values, of_packet, len(instant))
    heard = Receptions(
        arrival_ns=_arrivals(record, instant, beacon),
        epoch_ns=epochs_ns(time_ns, of_packet("acoustics.range_epoch")),
        beacon=beacon,
        kind=np.full(len(instant), kind),
        range=of_packet("acoustics.range"),
        beacon_position=of_packet("acoustics.ping_beacon_position"),
        has_pose=posed, platform_position=place, platform_attitude=turn,
        packet=values[_ALL].astype(np.float64)[instant] if _ALL in values
        else np.zeros((len(instant), count.shape[1], 3)),
        line=np.zeros(len(instant), np.int64),
    )
    return heard.chosen(np.argsort(heard.arrival_ns, kind="stable"))


def _arrivals(record: Record, instant: NDArray[np.intp], beacon: NDArray[np.intp]) -> Integers:
    """Arrivals in whole nanoseconds, after the instant before the one with the packet."""
    time_ns = record.time_ns
    late = time_ns[instant]
    if _ARRIVAL not in record.values:
        return late
    arrival = record.values[_ARRIVAL].astype(np.float64)[instant, beacon]
    whole = np.ceil(arrival * SECOND).astype(np.int64)
    return np.clip(whole, time_ns[np.maximum(instant - 1, 0)] + 1, late)


def _poses(values: Any, of_packet: Any, n: int) -> tuple[Flags, Floats, Floats]:
    if _PLACE not in values:
        return np.zeros(n, bool), np.zeros((n, 3)), np.zeros((n, 3))
    place, turn = of_packet(_PLACE), of_packet(_ATTITUDE)
    return np.any(place != 0, axis=1) | np.any(turn != 0, axis=1), place, turn
