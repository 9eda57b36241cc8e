"""How a lidar sits on its robot."""

from __future__ import annotations

from dataclasses import dataclass, field

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose


@storable("mount")
@dataclass(frozen=True, slots=True)
class Mount:
    """The laser's pose in the robot's base frame; `inverted` = mounted upside down.

    An inverted lidar sweeps clockwise as seen from above: its angles change sign before anything
    else looks at the scan.
    """

    T_base_laser: Pose = field(default_factory=Pose.identity)
    inverted: bool = False
