"""What the mapper remembers of one robot."""

from __future__ import annotations

from dataclasses import dataclass, field

from lineloom_core.geometry import Pose
from lineloom_core.mapping.site_view import RobotState
from lineloom_core.mapping.tracker import Tracker
from lineloom_core.scan import Mount


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A processed scan, fixed to the keyframe it was tracked against."""

    session: str
    seq: int
    stamp: float
    keyframe: int
    T_keyframe_laser: Pose


@dataclass
class RobotRecord:
    """Everything about a robot that its next scan depends on."""

    name: str
    mount: Mount = field(default_factory=Mount)
    tracker: Tracker | None = None
    track: int | None = None
    """Number of the track that it is on."""
    last_keyframe: int | None = None
    """The track's latest."""
    state: RobotState = "starting"
    session: str | None = None
    sessions: dict[str, None] = field(default_factory=dict)
    """All sessions seen, in their order."""
    seq: int | None = None
    stamp: float | None = None
    processed: int = 0
    unplaced: int = 0
    placed: list[PlacedScan] = field(default_factory=list)
    latest: PlacedScan | None = None
