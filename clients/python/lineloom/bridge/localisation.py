"""From the service's pose of a robot to the transform that ROS wants."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom.bridge.planar import Planar
from lineloom.bridge.scan_feed import ScanFeed
from lineloom.wire import Robot

_FOLLOWED = ("starting", "tracking")
"""States of a robot whose pose is of now; those who are lost or silent have the one of then."""


@dataclass(frozen=True)
class MapTransform:
    """Where a scan was taken.

    T: T_map_odom, or T_map_base where no odometry is used (to_base). component: in whose map
    frame; when it changes, or a merge moves it, the transform jumps. seq, stamp [ns]: of the scan.
    T_map_base with its covariance over x, y, theta, by rows, where one is known.
    """

    T: Planar
    to_base: bool
    component: str
    seq: int
    stamp: int
    T_map_base: Planar
    covariance: tuple[float | None, ...] | None


def map_transform(robot: Robot, feed: ScanFeed, *, odometry: bool) -> MapTransform | None:
    """Return the transform, or None while there is none to give: no pose yet, lost or silent, or
    the pose is of a scan that this start of the bridge did not send, or does not remember.

    odometry: whether scans carry it. Then it is T_map_odom or nothing: a base with two parents
    breaks the tree.
    """
    pose = robot.pose
    if pose is None or robot.component is None or robot.state not in _FOLLOWED:
        return None
    if robot.latest_session != feed.session or robot.latest_seq is None:
        return None
    scan = feed.sent(robot.latest_seq)
    if scan is None or (odometry and scan.T_odom_base is None):
        return None
    T_map_base = Planar(pose.x, pose.y, pose.theta)
    T = T_map_base
    if odometry and scan.T_odom_base is not None:
        T = T_map_base @ scan.T_odom_base.inverse()
    rows = None if pose.covariance is None else tuple(v for row in pose.covariance for v in row)
    return MapTransform(
        T, not odometry, robot.component, robot.latest_seq, scan.stamp, T_map_base, rows
    )
