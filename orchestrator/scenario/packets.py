"""Requirements on packets: enough bits, and receivers that use what packets hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sblcosim.models.acoustics.contents import CONTENTS, PLACED
from sblcosim.models.acoustics.packet import finest, has_angles, least_bits
from sblcosim.models.settings import packets
from sblcosim.models.settings.packets import DEFAULT, KEYS


def resolutions(acoustics: Any, beacons: int) -> dict[str, float]:
    """Keys derived from ``packet_bits``, before all others are filled in."""
    if not acoustics.packet_bits:
        return {}
    content = acoustics.packet_content or DEFAULT
    return packets.resolutions(content, acoustics.packet_bits, beacons, *_given(acoustics))


def problems(platform: Any, acoustics: Any, receiver: Any, beacons: int) -> Iterator[str]:
    """Contradictions in the tables of a scenario; one line each."""
    content = acoustics.packet_content
    if acoustics.packet_bits and acoustics.fmu is not None:
        yield "[acoustics] packet_bits: must be left out if there is another fmu"
    elif acoustics.packet_bits:
        yield from _too_long(acoustics, beacons)
    if acoustics.fmu is not None:
        return
    if content in PLACED and not platform.gps_shared:
        yield (
            "[acoustics] packet_content: must include positions of beacons, as gps_shared of "
            f"[platform] is false, got {content!r}"
        )
    if (
        CONTENTS[content].only_own
        and "pose_source" in receiver.model_fields_set and receiver.pose_source != "own_beacon"
    ):
        yield (
            "[receiver] pose_source: must be 'own_beacon', as packet_content of [acoustics] is, "
            f"got {receiver.pose_source!r}"
        )


def _too_long(acoustics: Any, beacons: int) -> Iterator[str]:
    content, bits = acoustics.packet_content, acoustics.packet_bits
    given = _given(acoustics)
    needed = least_bits(content, beacons, *given)
    if needed <= bits:
        return
    fit = finest(content, bits, beacons)
    said = [f"packet_content is {content!r}"] + [
        f"{key} is {value!r}" for key, value in zip(KEYS, given, strict=True) if value is not None
    ]
    advice = ""
    if fit is not None:
        advice = f"; {fit[0]:g} m" + (f" and {fit[1]:g}°" if has_angles(content) else "")
        advice += " would fit"
    yield (
        f"[acoustics] packet_bits: must be at least {needed}, as {' and '.join(said)}, "
        f"got {bits}{advice}"
    )


def _given(acoustics: Any) -> tuple[float | None, float | None]:
    """The given resolutions that have an effect."""
    first, second = (
        getattr(acoustics, key) if key in acoustics.model_fields_set else None for key in KEYS
    )
    return first, second if has_angles(acoustics.packet_content or DEFAULT) else None
