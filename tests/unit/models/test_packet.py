"""How many bits a packet takes, and what fits into so many."""

from __future__ import annotations

from importlib import resources

import pytest
from sblcosim.models.acoustics.packet import fields, finest, least_bits, packet_bits
from sblcosim.models.acoustics.variables import PACKET_CONTENT

CONTENTS = [*PACKET_CONTENT.values()]


def test_the_pose_to_a_centimetre_takes_ten_bytes() -> None:
    assert fields("pose", 0.01, 0.125) == {
        "slot": 6, "beacon": 2, "north, east": 26, "down": 7, "heading": 12, "roll, pitch": 16,
        "GPS class": 3, "checksum": 8,
    }
    assert packet_bits("pose", 0.01, 0.125) == 80
    assert packet_bits("own_beacon", 0.01, 0.125) == 52
    assert packet_bits("pose", 0.01, 0.125, beacons=8) == 81
    assert packet_bits("all_beacons", 0.01, 0.0, beacons=3) == 6 + 2 + 3 * 33 + 3 + 8


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("beacons", [3, 4, 8])
def test_the_finest_that_fits_fits_and_half_of_it_does_not(content: str, beacons: int) -> None:
    least = least_bits(content, beacons)
    assert finest(content, least - 1, beacons) is None
    before = None
    for bits in range(least, least + 200):
        found = finest(content, bits, beacons)
        assert found is not None
        step, angle = found
        assert packet_bits(content, step, angle, beacons) <= bits
        if step > 0.00125:
            assert packet_bits(content, step / 2, angle / 2, beacons) > bits
        assert before is None or all(a <= b for a, b in zip(found, before, strict=True))
        before = found
    assert finest(content, 0, beacons, 0.01, 0.1) is None
    assert finest(content, 10_000, beacons, 0.01, 0.1) == (0.01, 0.1)


def test_the_table_in_the_readme() -> None:
    readme = (resources.files("sblcosim.models.acoustics") / "README.md").read_text("utf-8")
    steps = ((0.01, 0.125), (0.05, 0.5), (0.2, 1.0), (0.0, 0.0))
    shown = [content for content in CONTENTS if f"| `{content}` |" in readme]
    assert len(shown) >= 4
    for content in shown:
        found = finest(content, 80)
        last = f"– ({least_bits(content)} bits at least)"
        if found is not None:
            last = f"{found[0]:g} m" + (f", {found[1]:g}°" if found[1] else "")
        bits = " | ".join(str(packet_bits(content, *pair)) for pair in steps)
        assert f"| `{content}` | {bits} | {last} |" in readme
