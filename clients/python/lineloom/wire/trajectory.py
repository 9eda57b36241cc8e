"""Where a robot has been."""

from __future__ import annotations

from lineloom.wire.base import Answer


class TrajectoryPose(Answer):
    """Pose of the base (the laser where no mount is set) at one scan, in `component`'s map."""

    session: str
    seq: int
    stamp: float
    component: str
    x: float
    y: float
    theta: float


class Trajectory(Answer):
    """Every processed scan of a robot in processing order, at one version of the map."""

    robot: str
    version: int
    poses: list[TrajectoryPose]
