"""From the service's pose of a robot to the transform that ROS wants."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom.wire import Robot

from lineloom_bridge.planar import Planar
from lineloom_bridge.scan_feed import ScanFeed


@dataclass(frozen=True)
class MapTransform:
    """to_base: it is T_map_base, where there is no odometry; else T_map_odom. component: in whose
    map frame; when it changes, or a merge moves it, the transform jumps."""

    T: Planar
    to_base: bool
    component: str


def map_transform(robot: Robot, feed: ScanFeed) -> MapTransform | None:
    """Return the transform, or None while there is none to give: no pose yet, lost, or the pose is
    of a scan that this start of the bridge did not send."""
    pose = robot.pose
    if pose is None or robot.component is None or robot.state == "lost":
        return None
    if robot.latest_session != feed.session or robot.latest_seq is None:
        return None
    T_map_base = Planar(pose.x, pose.y, pose.theta)
    T_odom_base = feed.odometry_at(robot.latest_seq)
    if T_odom_base is None:
        return MapTransform(T_map_base, to_base=True, component=robot.component)
    T_map_odom = T_map_base @ T_odom_base.inverse()
    return MapTransform(T_map_odom, to_base=False, component=robot.component)
