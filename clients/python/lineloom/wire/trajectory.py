"""Where a robot has been."""

from __future__ import annotations

from lineloom.wire.base import Answer, Settled


class TrajectoryPose(Answer):
    """Pose of the base (the laser where no mount is set) at one scan, in `component`'s map.

    Component and pose are null for a scan that fitted nowhere: a blocked lidar, a robot that was
    carried.
    """

    session: str
    seq: int
    stamp: float
    component: str | None
    x: float | None
    y: float | None
    theta: float | None

    @property
    def pose(self) -> tuple[float, float, float] | None:
        """x, y and theta, None for a scan that fitted nowhere."""
        if self.x is None or self.y is None or self.theta is None:
            return None
        return self.x, self.y, self.theta


class Trajectory(Answer):
    """Every processed scan of a robot in processing order, at one version of the map."""

    robot: str
    version: int
    settled: Settled = False
    poses: list[TrajectoryPose]
