"""What the benchmark of logs replays: recordings, and poses to hold the map against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from lineloom_core.geometry import Pose
from lineloom_core.scan import Scan
from numpy.typing import NDArray

Trust = Literal["reference", "pseudo", "doubtful", "none"]
"""Of poses to compare with: an independent reference or a simulator's truth; a naive search whose
agreement within 0.4 m and 6 degrees means right; the same where even that is unsure; none at all.
"""

Half = Literal["A", "B", ""]
"""Parameters may be chosen with one half of the buildings, and are shown on the other."""

_HALVES: dict[Half, tuple[str, ...]] = {
    "A": ("csail", "seattle", "acapulco", "corridor", "room-eng403", "three-lidars", "tinyslam"),
    "B": (
        "fr079", "freiburg-101", "orebro", "edmonton", "flat", "spin", "ydlidar", "fifty-beams",
        "odd-index",
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RigidPair:
    """Two lidars of one robot, by name. T_first_second: the second in the first one's frame."""

    first: str
    second: str
    T_first_second: Pose


@dataclass(frozen=True, eq=False)
class Recording:
    """One lidar's scans in the order of the recording.

    reference: (n, 3), poses of the laser in one frame for the whole log [m, m, rad], NaN where
    there is none. inverted: mounted upside down.
    """

    robot: str
    scans: tuple[Scan, ...]
    reference: NDArray[np.float64]
    inverted: bool = False

    def __post_init__(self) -> None:
        if self.reference.shape != (len(self.scans), 3):
            raise ValueError(
                f"reference: {self.robot} has {len(self.scans)} scans, so it must have shape "
                f"({len(self.scans)}, 3), not {self.reference.shape}"
            )


@dataclass(frozen=True, eq=False)
class BenchLog:
    """A log: the recordings of all its lidars. rigid: how two of one robot are mounted."""

    recordings: tuple[Recording, ...]
    trust: Trust
    rigid: RigidPair | None = None


class LogSource(Protocol):
    """Where a log comes from. It travels to other processes, and logs that are large stay here."""

    def __hash__(self) -> int:
        """Equal sources give equal logs."""

    @property
    def name(self) -> str:
        """What the table calls it."""

    @property
    def half(self) -> Half:
        """The half that its building belongs to."""

    def load(self) -> BenchLog:
        """Read it, or make it. Raises ValueError or OSError where it cannot be read."""


def half_of(name: str) -> Half:
    """Return the half of a log's building; "" for one that nobody has assigned."""
    for half, beginnings in _HALVES.items():
        if name.startswith(beginnings):
            return half
    return ""


def no_reference(scans: int) -> NDArray[np.float64]:
    """Return poses that are unknown, shape (scans, 3)."""
    return np.full((scans, 3), np.nan)
