"""Packet contents, one row each. Keys, equations, bits and assumptions are derived from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ..declaration import DeclarationError
from ..numbered import in_order


@dataclass(frozen=True)
class Content:
    """What a packet says about the positions of the platform and its beacons.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    words
        Text for the description of the key.
    beacons
        Whose positions the packet holds: those of all beacons, of its own beacon, or of none.
    pose
        Whether it holds the platform's position and attitude. Without positions of beacons, the
        pose determines where they are.
    """

    number: int
    words: str
    beacons: Literal["all", "own", "none"]
    pose: bool = False

    def __post_init__(self) -> None:
        if self.beacons == "none" and not self.pose:
            raise DeclarationError(
                f"packet content {self.number}: must have beacons or a pose, got neither"
            )

    @property
    def is_everything(self) -> bool:
        """Whether the packet holds a pose and the positions of all beacons."""
        return self.pose and self.beacons == "all"

    @property
    def only_own(self) -> bool:
        """Whether the packet holds the position of its own beacon and nothing else."""
        return self.beacons == "own" and not self.pose

    @property
    def pose_source(self) -> str:
        """The best source of a pose in this packet, as a value of the key ``pose_source``."""
        if self.pose:
            return "reported_pose"
        return "beacon_positions" if self.beacons == "all" else "own_beacon"

    def places(self, beacons: int) -> int:
        """Number of positions in a packet of a platform with this many beacons."""
        return {"all": beacons, "own": 1, "none": 0}[self.beacons] + self.pose


CONTENTS: Mapping[str, Content] = in_order("packet contents", {
    "everything": Content(1, "the pose and the positions of all beacons", "all", pose=True),
    "own_beacon": Content(2, "the position of its own beacon", "own"),
    "all_beacons": Content(3, "the positions of all beacons", "all"),
    "pose": Content(4, "the pose", "none", pose=True),
})
PACKET_CONTENT: Mapping[int, str] = {it.number: name for name, it in CONTENTS.items()}
POSED = tuple(name for name, it in CONTENTS.items() if it.pose)
"""Names of the contents with a pose."""
PLACED = tuple(name for name, it in CONTENTS.items() if it.beacons == "none")
"""Names of the contents in which only the pose says where the beacons are."""
