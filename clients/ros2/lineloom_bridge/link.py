"""What the bridge asks the service for, on a thread of its own: ROS never waits for the network."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lineloom import Client
from lineloom.errors import LineloomError
from lineloom.wire import MountSettings

from lineloom_bridge.lines import LineList, line_list
from lineloom_bridge.localisation import MapTransform, map_transform
from lineloom_bridge.occupancy import Grid, GridError, read_grid
from lineloom_bridge.planar import MountPose
from lineloom_bridge.scan_feed import ScanFeed


@dataclass(frozen=True)
class Wishes:
    """What to ask for, and how often [s]."""

    pose_period: float = 0.5
    map_period: float = 5.0
    grid: bool = True
    lines: bool = True


@dataclass(frozen=True)
class Handlers:
    """Who takes the answers. trouble: is told in plain words, once per kind of trouble."""

    transform: Callable[[MapTransform], Any]
    grid: Callable[[Grid], Any]
    lines: Callable[[LineList], Any]
    trouble: Callable[[str], Any]


class Link:
    """Polls the service until closed."""

    def __init__(
        self,
        client: Client,
        site: str,
        robot: str,
        feed: ScanFeed,
        wishes: Wishes,
        handlers: Handlers,
    ) -> None:
        self._client = client
        self._site, self._robot = site, robot
        self._feed = feed
        self._wishes = wishes
        self._handlers = handlers
        self._component: str | None = None
        self._version: int | None = None
        self._trouble = ""
        self._mount: MountSettings | None = None
        self._mounted = threading.Event()
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._repeat, args=(step, period), daemon=True)
            for step, period in (
                (self.ask_pose, wishes.pose_period),
                (self.ask_map, wishes.map_period),
            )
        ]

    def start(self) -> None:
        """Begin to ask."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop asking."""
        self._stopping.set()
        for thread in self._threads:
            thread.join(timeout=5.0)

    @property
    def mounted(self) -> bool:
        """Whether the service knows how the lidar sits: scans may follow."""
        return self._mounted.is_set()

    def offer_mount(self, mount: MountPose) -> None:
        """Have the service told how the lidar sits, as soon as it can be reached."""
        T = mount.T_base_laser
        self._mount = MountSettings(x=T.x, y=T.y, theta=T.theta, inverted=mount.inverted)

    def ask_pose(self) -> None:
        """Tell the mount where that is due, ask for the robot's pose, hand on the transform."""
        if not self.mounted:
            if self._mount is None:
                return
            self._client.set_mount(self._site, self._robot, self._mount)
            self._mounted.set()
        found = map_transform(self._client.robot(self._site, self._robot), self._feed)
        if found is not None:
            self._component = found.component
            self._handlers.transform(found)

    def ask_map(self) -> None:
        """Ask for the map of the robot's component, where it has changed since."""
        component = self._component
        if component is None or not (self._wishes.grid or self._wishes.lines):
            return
        answer = self._client.map(self._site, component=component)
        if answer.version == self._version:
            return
        if self._wishes.lines:
            self._handlers.lines(line_list(answer, component))
        if self._wishes.grid:
            content = self._client.map_file(self._site, "nav2", component=component)
            self._handlers.grid(read_grid(content))
        self._version = answer.version

    def _repeat(self, step: Callable[[], None], period: float) -> None:
        while not self._stopping.wait(period):
            try:
                step()
            except (LineloomError, GridError) as error:
                self._tell(str(error))
            else:
                self._trouble = ""

    def _tell(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._handlers.trouble(trouble)
