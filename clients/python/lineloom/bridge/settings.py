"""What may be set of a bridge, with the defaults: the parameters of the ROS node."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

ODOMETRY = ("tf", "topic", "none")


class SettingError(ValueError):
    """A parameter's value cannot be; the message names the parameter."""


@dataclass(frozen=True)
class BridgeSettings:
    """Every parameter by its name; times in seconds."""

    url: str = ""
    token: str = ""
    site: str = "default"
    robot: str = "robot"
    queue: str = ""
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    frame_prefix: str = ""
    odometry: str = "tf"
    publish_tf: bool = True
    publish_grid: bool = True
    publish_lines: bool = True
    max_rate: float = 10.0
    pose_period: float = 0.2
    map_period: float = 5.0
    transform_tolerance: float = 1.0
    transform_timeout: float = 0.5
    silent_after: float = 2.0

    def __post_init__(self) -> None:
        if self.odometry not in ODOMETRY:
            raise SettingError(f"odometry: {self.odometry!r} is none of {', '.join(ODOMETRY)}")
        for name in ("pose_period", "map_period", "silent_after"):
            if not getattr(self, name) > 0.0:
                raise SettingError(f"{name}: must be more than 0 s, is {getattr(self, name)}")
        for name in ("transform_tolerance", "transform_timeout", "max_rate"):
            if not getattr(self, name) >= 0.0:
                raise SettingError(f"{name}: must not be negative, is {getattr(self, name)}")
        for name in ("site", "robot", "map_frame", "odom_frame", "base_frame"):
            if not getattr(self, name):
                raise SettingError(f"{name}: must not be empty")

    @property
    def odom(self) -> str:
        """The odometry's frame, prefix included."""
        return self.frame_prefix + self.odom_frame

    @property
    def base(self) -> str:
        """The base's frame, prefix included."""
        return self.frame_prefix + self.base_frame

    def map_of(self, component: str) -> str:
        """The map's frame of a component: robots that share a tree need one for each."""
        return self.map_frame.replace("{component}", component)

    def queue_file(self) -> Path:
        """Where scans wait that are not delivered yet."""
        if self.queue:
            return Path(self.queue)
        name = f"lineloom-{self.site}-{self.robot}.db".replace("/", "_")
        return Path.home() / ".ros" / name


DEFAULTS: dict[str, Any] = asdict(BridgeSettings())


def read_settings(values: dict[str, Any]) -> BridgeSettings:
    """Return settings of what people give: a robot may be called 7, a rate may be 10.

    Raises SettingError.
    """
    given = {f.name: _as(f.name, DEFAULTS[f.name], values[f.name]) for f in fields(BridgeSettings)
             if f.name in values}  # fmt: skip
    return BridgeSettings(**given)


def _as(name: str, default: Any, value: Any) -> Any:
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        raise SettingError(f"{name}: must be true or false, is {value!r}")
    if isinstance(default, float):
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        raise SettingError(f"{name}: must be a number, is {value!r}")
    if isinstance(value, bool):  # yes and no are words in YAML
        raise SettingError(f"{name}: must be text, is {value!r}; put it in quotes")
    return str(value)
