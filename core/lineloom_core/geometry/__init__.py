"""Angles, rigid motions of the plane, and line segments."""

from lineloom_core.geometry.angles import angle_difference, circular_mean, wrap
from lineloom_core.geometry.pose import Pose

__all__ = ["Pose", "angle_difference", "circular_mean", "wrap"]
