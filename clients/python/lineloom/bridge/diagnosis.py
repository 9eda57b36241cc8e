"""How a bridge is doing, in words: what /diagnostics says."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lineloom.bridge.localisation import MapTransform
from lineloom.bridge.stamps import SECOND
from lineloom.wire import Robot

OK, WARN, ERROR, STALE = range(4)
"""As diagnostic_msgs/DiagnosticStatus numbers them."""


@dataclass(frozen=True)
class Diagnosis:
    """level: OK, WARN, ERROR or STALE. values: pairs of key and value."""

    level: int
    message: str
    values: tuple[tuple[str, str], ...]


@dataclass
class Observations:
    """What a bridge has seen so far. Times: of the monotonic clock [s]; 0 for never.

    trouble: why the pose, or the map, cannot be had, by what was asked for. hindrance: why no scans
    can be sent.
    """

    began: float
    trouble: dict[str, str] = field(default_factory=dict)
    hindrance: str = ""
    robot: Robot | None = None
    placed: MapTransform | None = None
    placed_at: float = 0.0
    scan_at: float = 0.0
    scans: int = 0
    dropped: int = 0
    dropped_at: float = 0.0
    paused: bool = False


def diagnose(seen: Observations, queue: Any, now: float, silent_after: float) -> Diagnosis:
    """Return what is to be said. queue: `Outbox.stats()`. now: of the monotonic clock [s]."""
    level, message = _judge(seen, now, silent_after)
    values = [
        ("scans received", str(seen.scans)),
        ("scans dropped for want of a transform", str(seen.dropped)),
        ("scans queued", str(queue.pending)),
        ("scans delivered", str(queue.delivered)),
        ("scans refused", str(queue.refused)),
    ]
    if seen.robot is not None:
        values += [
            ("state", seen.robot.state),
            ("component", seen.robot.component or ""),
            ("scans not mapped yet", str(seen.robot.scans.pending)),
        ]
        values += [(f"health {i}", text) for i, text in enumerate(seen.robot.health)]
    if seen.placed is not None:
        values.append(("stamp of the latest pose", f"{seen.placed.stamp / SECOND:.3f}"))
        values.append(("seconds since the latest pose", f"{now - seen.placed_at:.1f}"))
    return Diagnosis(level, message, tuple(values))


def _judge(seen: Observations, now: float, silent_after: float) -> tuple[int, str]:
    """Name what stands in the way of a pose, the first thing first."""
    if seen.trouble.get("pose"):
        return ERROR, f"no pose from the service: {seen.trouble['pose']}"
    if seen.paused:
        return WARN, "new measurements are paused"
    if seen.hindrance:
        return ERROR, seen.hindrance
    if now - max(seen.scan_at, seen.began) > silent_after:
        return STALE, f"no scan for {now - max(seen.scan_at, seen.began):.0f} s"
    if now - seen.dropped_at < silent_after and seen.dropped:
        return WARN, "scans are dropped: odometry does not come in time"
    robot = seen.robot
    if robot is None or robot.pose is None:
        return WARN, "no pose yet"
    if robot.state not in ("starting", "tracking"):
        return ERROR, f"the robot is {robot.state}: no transform is published"
    if now - seen.placed_at > silent_after:
        return WARN, f"no new pose for {now - seen.placed_at:.0f} s: mapping is behind"
    if seen.trouble.get("map"):
        return WARN, f"no map from the service: {seen.trouble['map']}"
    if robot.health:
        return WARN, robot.health[0]
    return OK, "localised"
