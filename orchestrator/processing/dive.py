"""A log as a page replays it: what its receivers are given, decided here, as one text.

A page plays the ports to the receivers that it has, with the settings that it has. Everything that
`sblcosim.process` decides before receivers run is decided here: which ranges count, where receivers
start, the time between updates. So a page has the estimates of `sblcosim.process`, to the last bit.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sblcosim.fmus.host.nanoseconds import SECOND

from ..data.estimates import Estimates
from ..data.truth import Truth
from ..errors import ConfigurationError, shortened
from ..logs.columns import SIGNED
from ..logs.log import Log
from ..logs.read import read_log
from ..scenario.files import naming_files
from ..scenario.overrides import Changes, pairs
from ..scenario.scenario import Receivers, Scenario
from ..scenario.schema import toml
from ..scenario.sources import Choice, choice_of
from ..simulation.how import How
from ..web.page import content
from ..web.playback import some_of
from .align import aligned
from .knowing import USUAL, longest_of, silences
from .pages import played
from .playing import PORTS, Played
from .processed import Processed
from .quality import TRUTH_GAP_S, middles_of
from .remarks import remarks
from .replaying import AFTER
from .running import decided, ports_of, ran
from .settings import Given, Settled, settled

MOST_INSTANTS = 100_000
"""Most instants of a log at which something is new, so that a page replays it in a moment."""
_LATER = 2**53
"""Times of a page are at most this [ns]: whole numbers that a double holds."""


@dataclass(frozen=True)
class PreparedDive:
    """A log, ready for a page.

    Attributes
    ----------
    scenario
        The settings with which `sblcosim.process` would run.
    facts
        What a page must know about the log, as plain data.
    tables
        Numbers by name, (rows, columns).
    """

    scenario: Scenario
    facts: Mapping[str, Any]
    tables: Mapping[str, NDArray[np.float64]]

    def packed(self, **more: Any) -> str:
        """Everything as one text, which `explore/js/recorded.js` reads.

        It is base64 of zlib of: the length of a JSON text [bytes, 32 bits], the text, filled up to
        8 bytes, and all numbers as doubles, table by table, column by column; little-endian.

        Parameters
        ----------
        more
            Further facts.
        """
        sizes = {name: [*table.shape] for name, table in self.tables.items()}
        text = json.dumps({**self.facts, **more, "tables": sizes}, allow_nan=False).encode()
        head = len(text).to_bytes(4, "little") + text
        numbers = b"".join(table.T.astype("<f8").tobytes() for table in self.tables.values())
        whole = head + bytes(-len(head) % 8) + numbers
        return b64encode(zlib.compress(whole, 9)).decode()


@naming_files
def recorded_dive(
    log: str | Path | Log, receiver: Receivers = (), overrides: Changes = (), *,
    scenario: Given = None, mapping: str | Path | None = None,
) -> PreparedDive:
    """A log, ready for a page.

    Parameters
    ----------
    log, receiver, overrides, scenario, mapping
        As in `sblcosim.process`. Receivers run here only if the truth has a clock or a frame of its
        own: then it is moved to the estimates of the first one.

    Raises
    ------
    ConfigurationError
        As in `sblcosim.process`, or the log is too long for a page.
    FmuError
        A receiver cannot be built or has failed.
    """
    heard = log if isinstance(log, Log) else read_log(log, mapping)
    ready = settled(heard, scenario, overrides)
    choice = choice_of(ready.scenario, receiver)
    given = ports_of(ready)
    count = len(given.time_ns)
    if not 2 < count <= MOST_INSTANTS:
        raise ConfigurationError(
            f"{shortened(heard.called)}: must have 3 to {MOST_INSTANTS:,} instants with something "
            f"new to be replayed in a page, got {count:,}; 'sblcosim process' takes any number"
        )
    truth, moved = _truth(ready, choice)
    said = [*ready.log.counted(), *ready.log.remarks,
            *remarks(ready, Choice({}, {}), given), *moved]
    shown = played(Processed(log=ready.log, scenario=ready.scenario, made={}, truth=truth))
    facts = {
        "log": ready.log.name, "title": ready.log.meta.title or ready.log.name,
        "command": _command(heard, scenario, overrides, mapping),
        "said": said, "beacons": ready.slots, "names": [*ready.log.beacons],
        "simulated": ready.newest, "plane": ready.log.meta.dimension == 2,
        "rough": scenario is None and heard.scenario is None,
        "differences": SIGNED in ready.log.kinds, "after": AFTER,
        "truth_gap_ns": round(TRUTH_GAP_S * SECOND),
        "interval_ns": ready.interval_ns, "start_ns": given.start_ns - ready.log.start_ns,
        "zero_ns": str(ready.log.start_ns), "origin": ready.origin.tolist(),
        "parameters": {
            name: {key: np.ravel(value).tolist() for key, value in decided(
                ready, told, 0.0).items()}
            for name, told in (("usual", False), ("told", True))
        },
        "knowing": None if ready.newest else _knowing(ready.log),
        "shown": content(shown),
    }
    return PreparedDive(ready.scenario, facts, _tables(ready.log, given, truth))


def _truth(ready: Settled, choice: Choice) -> tuple[Truth | None, list[str]]:
    """The truth on the clock and in the frame of the log, and what was done to it."""
    log = ready.log
    if log.truth is None:
        return None, []
    none = Estimates(epoch_ns=np.zeros(0, np.int64), position=np.zeros((0, 3)))
    found, main = aligned(log, none), ""
    if found is None:
        made = ran(ready, choice, How(None, None)).estimates
        main = next((label for label in choice.receivers if label in made), "")
        found = aligned(log, made[main]) if main else None
    if found is None:
        return None, ["truth: not used, as too few estimates have a time in common with it"]
    words = found[1].told(main)
    return found[0], [words] if words else []


def _command(
    log: Log, scenario: Given, overrides: Changes, mapping: str | Path | None
) -> dict[str, Any]:
    """What `sblcosim process` must be told for these settings, as plain data."""
    return {
        "log": log.source or log.name,
        "scenario": str(scenario) if isinstance(scenario, str | Path) else None,
        "mapping": None if mapping is None else str(mapping),
        "set": {".".join(path): toml(value) for path, value in pairs(overrides)},
    }


def _knowing(log: Log) -> dict[str, Any]:
    """Where estimates know next to nothing; see `knowing.py`."""
    longest, silent = longest_of(log), silences(log)[0]
    return {
        "longest": longest if isfinite(longest) else None,
        "usual": USUAL,
        "silences": [
            [begin - log.start_ns, min(end - log.start_ns, _LATER)]
            for begin, end in silent.tolist()
        ],
    }


def _tables(log: Log, given: Played, truth: Truth | None) -> dict[str, NDArray[np.float64]]:
    """Ports at the ticks, the truth, and what residuals are made from.

    Times count from the start of the log, those of the ports from `Played.start_ns` [ns].
    """
    heard, start = log.receptions, log.start_ns
    tables: dict[str, Any] = {
        "time": given.time_ns,
        **{v.name: given.values[v.name].reshape(len(given.time_ns), -1) for v in PORTS},
        "heard.epoch": heard.epoch_ns - start, "heard.beacon": heard.beacon,
        "heard.range": heard.range, "heard.place": heard.beacon_position,
        "depth.epoch": log.depth_ns - start, "depth.depth": log.depth,
    }
    if SIGNED in log.kinds:
        tables["heard.middle"] = middles_of(heard)
    if truth is not None:
        some = some_of(len(truth.time_ns))
        tables["truth.time"] = truth.time_ns[some] - start
        tables["truth.position"] = truth.position[some]
        if truth.velocity is not None:
            tables["truth.velocity"] = truth.velocity[some]
    each = {name: np.asarray(table, np.float64) for name, table in tables.items()}
    return {name: it[:, None] if it.ndim == 1 else it for name, it in each.items()}
