"""Answers of the service as ROS messages, of whatever classes: rclpy's or the ones for DDS."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from lineloom.bridge.diagnosis import Diagnosis
from lineloom.bridge.lines import LineList
from lineloom.bridge.link import ComponentChange
from lineloom.bridge.localisation import MapTransform
from lineloom.bridge.occupancy import Grid
from lineloom.bridge.planar import Planar
from lineloom.bridge.settings import BridgeSettings
from lineloom.bridge.stamps import SECOND, set_stamp

_LINE_WIDTH_M = 0.05
_PLANAR_IN_SIX = (0, 1, 5)
"""Rows of x, y and yaw in a covariance over x, y, z, roll, pitch, yaw."""


@dataclass(frozen=True)
class Messages:
    """Makes messages. types: has the message classes by their names, and `level(int)`, for a byte
    is bytes in rclpy and a number elsewhere."""

    types: Any
    settings: BridgeSettings

    def transform(self, found: MapTransform) -> Any:
        """Return the TransformStamped. Odometry carries the base on from where the scan was taken,
        so that one is good for `transform_tolerance` more; a base alone is where it was."""
        message = self.types.TransformStamped()
        ahead = 0.0 if found.to_base else self.settings.transform_tolerance
        set_stamp(message.header.stamp, found.stamp + round(ahead * SECOND))
        message.header.frame_id = self.settings.map_of(found.component)
        message.child_frame_id = self.settings.base if found.to_base else self.settings.odom
        message.transform.translation.x = found.T.x
        message.transform.translation.y = found.T.y
        _turn(message.transform.rotation, found.T)
        return message

    def pose(self, found: MapTransform) -> Any:
        """Return the PoseWithCovarianceStamped of the base at the scan's time."""
        message = self.types.PoseWithCovarianceStamped()
        set_stamp(message.header.stamp, found.stamp)
        message.header.frame_id = self.settings.map_of(found.component)
        place = message.pose.pose
        place.position.x, place.position.y = found.T_map_base.x, found.T_map_base.y
        _turn(place.orientation, found.T_map_base)
        covariance = [0.0] * 36
        for i, row in enumerate(_PLANAR_IN_SIX):
            for j, column in enumerate(_PLANAR_IN_SIX):
                value = None if found.covariance is None else found.covariance[3 * i + j]
                covariance[6 * row + column] = 0.0 if value is None else float(value)
        message.pose.covariance = covariance
        return message

    def grid(self, grid: Grid, component: str, now: int) -> Any:
        """Return the OccupancyGrid. now: nanoseconds."""
        message = self.types.OccupancyGrid()
        message.header.frame_id = self.settings.map_of(component)
        set_stamp(message.header.stamp, now)
        message.info = self.metadata(grid, now)
        message.data = grid.data
        return message

    def metadata(self, grid: Grid, now: int) -> Any:
        """Return the MapMetaData of a grid."""
        message = self.types.MapMetaData()
        set_stamp(message.map_load_time, now)
        message.resolution = grid.resolution
        message.width, message.height = grid.width, grid.height
        message.origin.position.x, message.origin.position.y = grid.x, grid.y
        _turn(message.origin.orientation, Planar())
        return message

    def lines(self, lines: LineList, component: str, now: int) -> Any:
        """Return the LINE_LIST Marker."""
        message = self.types.Marker()
        message.header.frame_id = self.settings.map_of(component)
        set_stamp(message.header.stamp, now)
        message.ns, message.id = "lineloom", 0
        message.type, message.action = self.types.Marker.LINE_LIST, self.types.Marker.ADD
        message.scale.x = _LINE_WIDTH_M
        message.pose.orientation.w = 1.0
        message.points = [self.types.Point(x=x, y=y, z=0.0) for x, y in lines.points]
        message.colors = [self.types.ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in lines.colours]
        return message

    def component(self, change: ComponentChange) -> Any:
        """Return the String of a change, as JSON."""
        told = {
            "robot": self.settings.robot,
            "component": change.component,
            "before": change.before,
            "merged": change.merged,
            "frame": self.settings.map_of(change.component),
        }
        return self.types.String(data=json.dumps(told))

    def diagnosis(self, found: Diagnosis, now: int) -> Any:
        """Return the DiagnosticArray."""
        status = self.types.DiagnosticStatus()
        status.level = self.types.level(found.level)
        status.name = f"lineloom_bridge: {self.settings.robot}"
        status.message, status.hardware_id = found.message, self.settings.robot
        status.values = [self.types.KeyValue(key=key, value=value) for key, value in found.values]
        message = self.types.DiagnosticArray()
        set_stamp(message.header.stamp, now)
        message.status = [status]
        return message


def _turn(rotation: Any, pose: Planar) -> None:
    rotation.x, rotation.y, rotation.z, rotation.w = pose.quaternion
