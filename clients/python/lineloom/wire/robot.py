"""A robot: its settings, and how it is doing."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict

from lineloom.wire.base import Answer, Number, Request, Settled
from lineloom.wire.pose import UncertainPose
from lineloom.wire.site import ScanCounts

RobotState = Literal["starting", "tracking", "lost", "silent"]


class MountSettings(Request):
    """The laser's pose in the robot's base frame; inverted = mounted upside down."""

    # A misspelt setting would silently do nothing.
    model_config = ConfigDict(strict=True, extra="forbid")

    x: Number = 0.0
    y: Number = 0.0
    theta: Number = 0.0
    inverted: bool = False


class RobotSettings(Request):
    """What `PUT …/robots/{robot}` sets. It holds for the scans that follow."""

    model_config = ConfigDict(strict=True, extra="forbid")

    mount: MountSettings | None = None


class Robot(Answer):
    """A robot at its latest processed scan.

    pose: of the base (of the laser where no mount is set) in the component's map frame; null
    before the first scan is placed. health: what an operator should know, in plain words. state:
    `silent` where nothing has come for long. last_received: when its last scan came, by the
    server's clock [s since 1970], null where that was before the service started; silent_for_s:
    since then, or since the start.
    """

    robot: str
    site: str
    component: str | None = None
    settled: Settled = False
    pose: UncertainPose | None = None
    state: RobotState
    scans: ScanCounts
    keyframes: int = 0
    latest_stamp: float | None = None
    latest_session: str | None = None
    latest_seq: int | None = None
    last_received: float | None = None
    silent_for_s: float | None = None
    mount: MountSettings | None = None
    health: list[str]


class RobotList(Answer):
    """The robots of a site."""

    site: str
    version: int
    settled: Settled = False
    robots: list[Robot]
