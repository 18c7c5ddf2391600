"""Paths as MCAP (https://mcap.dev) with messages of ROS 2, for Foxglove, rosbags and ROS.

Each path has the topics ``/NAME/odometry`` and, with an origin, ``/NAME/fix``.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import ConfigurationError, escaped
from ..tracks.place import Origin
from . import ros
from .diver_path import DiverPath
from .names import safe

FILE = "path.mcap"
Message = tuple[int, int, bytes]
"""Time since 1970 [ns], index of its topic, content."""


def write(
    folder: Path, title: str, paths: Sequence[DiverPath], origin: Origin | None, start_ns: int
) -> None:
    """Write all known points of all paths, in the order of their times.

    Parameters
    ----------
    start_ns
        Time 0 since 1970 [ns].

    Raises
    ------
    ConfigurationError
        A time is too late for a message of ROS 2.
    """
    topics: list[tuple[str, str, str]] = []
    streams: list[Iterator[Message]] = []
    for name, path in zip(safe(path.name for path in paths), paths, strict=True):
        ordered = path.in_time()
        _check_times(ordered, start_ns)
        for kind, stream in _streams(name, ordered, origin, start_ns, len(topics)):
            topics.append((f"/{name}/{kind}", path.name, _SCHEMAS[kind]))
            streams.append(stream)
    about = {"title": escaped(title)}
    if origin is not None:
        about |= {name: repr(getattr(origin, name)) for name in origin.__slots__}
    with (folder / FILE).open("wb") as file:
        _write(file, topics, heapq.merge(*streams, key=lambda message: message[0]), about)


_SCHEMAS = {"odometry": ros.ODOMETRY, "fix": ros.NAV_SAT_FIX}


def _streams(
    name: str, path: DiverPath, origin: Origin | None, start_ns: int, first: int
) -> Iterator[tuple[str, Iterator[Message]]]:
    """The kinds of messages of a path, each with its messages."""
    stamps = path.time_ns + start_ns
    times = stamps.tolist()
    messages = ros.odometry(
        name, stamps, path.position, path.velocity, path.covariance, path.velocity_covariance
    )
    yield "odometry", zip(times, [first] * len(times), messages, strict=True)
    if origin is not None:
        latitude, longitude, depth = origin.geographic(path.position).T
        geographic = np.column_stack([latitude, longitude, origin.height_m - depth])
        fixes = ros.fixes(name, stamps, geographic, path.covariance)
        yield "fix", zip(times, [first + 1] * len(times), fixes, strict=True)


def _write(
    file: IO[bytes], topics: Sequence[tuple[str, str, str]], messages: Iterator[Message],
    about: dict[str, str],
) -> None:
    from mcap.writer import CompressionType, Writer  # an extra

    writer: Any = Writer(file, compression=CompressionType.NONE)
    writer.start(profile="ros2", library="sblcosim")
    schemas = {
        message: writer.register_schema(message, "ros2msg", ros.definition(message).encode())
        for message in dict.fromkeys(message for _, _, message in topics)
    }
    channels = [
        writer.register_channel(topic, "cdr", schemas[message], {"name": escaped(name)})
        for topic, name, message in topics
    ]
    writer.add_metadata("sblcosim", about)
    for sequence, (time, index, content) in enumerate(messages):
        logged = max(time, 0)  # it has no sign
        writer.add_message(channels[index], logged, content, logged, sequence)
    writer.finish()


def _check_times(path: DiverPath, start_ns: int) -> None:
    """Refuse times after those of a stamp; also such that exceed 64 bits."""
    if len(path) and int(path.time_ns[-1]) + start_ns > ros.LAST_NS:
        raise ConfigurationError(
            f"path of {path.name}: times of mcap must be before 2038-01-19, as stamps of ROS 2 "
            f"are, got {(int(path.time_ns[-1]) + start_ns) / 1e9:.0f} s after 1970"
        )
