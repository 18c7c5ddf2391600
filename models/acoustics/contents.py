"""What a packet says: a row for each content. Keys, equations, bits and assumptions follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ..numbered import in_order


@dataclass(frozen=True)
class Content:
    """What a packet says of where the platform is.

    Attributes
    ----------
    number
        Its value in the FMU; never reused.
    words
        The same, for the description of the key.
    beacons
        Whose positions it has: of all beacons, of its own one, or of none.
    pose
        Whether it has position and attitude of the platform. If it has no positions of beacons,
        they are where the pose puts them.
    """

    number: int
    words: str
    beacons: Literal["all", "own", "none"]
    pose: bool = False

    def __post_init__(self) -> None:
        if self.beacons == "none" and not self.pose:
            raise ValueError(f"packet content {self.number}: must have beacons or a pose, got none")

    @property
    def is_everything(self) -> bool:
        """Whether there is no more to say."""
        return self.pose and self.beacons == "all"

    @property
    def only_own(self) -> bool:
        """Whether it says where its own beacon is, and nothing else of the platform."""
        return self.beacons == "own" and not self.pose

    @property
    def pose_source(self) -> str:
        """The best that a receiver can use of it, as the key ``pose_source``."""
        if self.pose:
            return "reported_pose"
        return "beacon_positions" if self.beacons == "all" else "own_beacon"

    def places(self, beacons: int) -> int:
        """Number of positions in a packet, of so many beacons."""
        return {"all": beacons, "own": 1, "none": 0}[self.beacons] + self.pose


CONTENTS: Mapping[str, Content] = in_order("packet contents", {
    "everything": Content(1, "its pose and the positions of all beacons", "all", pose=True),
    "own_beacon": Content(2, "that of its own beacon", "own"),
    "all_beacons": Content(3, "those of all", "all"),
    "pose": Content(4, "the pose", "none", pose=True),
})
PACKET_CONTENT: Mapping[int, str] = {it.number: name for name, it in CONTENTS.items()}
POSED = tuple(name for name, it in CONTENTS.items() if it.pose)
"""Names of those with a pose."""
PLACED = tuple(name for name, it in CONTENTS.items() if it.beacons == "none")
"""Names of those of which only the pose says where beacons are."""
