"""How a robot is doing."""

from typing import Literal

RobotState = Literal["starting", "tracking", "lost"]
