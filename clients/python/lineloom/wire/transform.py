"""Where one robot is, seen from another."""

from __future__ import annotations

from lineloom.wire.base import Answer, Covariance, Settled
from lineloom.wire.pose import PoseAnswer


class Transform(Answer):
    """Pose of robot_b's base in robot_a's base frame, both at their latest scans.

    covariance: 3x3 over x, y, theta of T_a_b, in robot_a's frame; null where a robot's own is
    not known. constraints: the accepted non-sequential constraints that hold the two together.
    """

    robot_a: str
    robot_b: str
    component: str
    version: int
    settled: Settled = False
    T_a_b: PoseAnswer
    covariance: Covariance | None = None
    constraints: list[str]
