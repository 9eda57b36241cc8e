"""What the bridge asks the service for, on threads of its own: ROS never waits for the network."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lineloom.bridge.lines import LineList, line_list
from lineloom.bridge.localisation import MapTransform, map_transform
from lineloom.bridge.occupancy import Grid, GridError, read_grid
from lineloom.bridge.planar import MountPose
from lineloom.bridge.scan_feed import ScanFeed
from lineloom.bridge.settings import BridgeSettings
from lineloom.client import Client
from lineloom.errors import LineloomError, NotFoundError
from lineloom.wire import MountSettings, Robot


@dataclass(frozen=True)
class ComponentChange:
    """The robot is in another component now; before: None at first. merged: the former one was
    absorbed, so its frame is gone."""

    component: str
    before: str | None
    merged: bool


@dataclass(frozen=True)
class Handlers:
    """Who takes the answers.

    robot: every answer about the robot. transform: once for each scan with a pose. trouble:
    after each question, what was asked for ("pose", "map") and why in vain; "" where answered.
    """

    robot: Callable[[Robot], Any]
    transform: Callable[[MapTransform], Any]
    component: Callable[[ComponentChange], Any]
    grid: Callable[[Grid, str], Any]
    lines: Callable[[LineList, str], Any]
    trouble: Callable[[str, str], Any]


class Link:
    """Polls the service until closed."""

    def __init__(
        self, client: Client, settings: BridgeSettings, feed: ScanFeed, handlers: Handlers
    ) -> None:
        self._client = client
        self._settings = settings
        self._site, self._robot = settings.site, settings.robot
        self._feed = feed
        self._handlers = handlers
        self._component: str | None = None
        self._seq: int | None = None
        self._shown: tuple[str, int] | None = None
        self._mount: MountSettings | None = None
        self._mounted = threading.Event()
        self._stopping = threading.Event()
        self._map_is_due = threading.Event()
        self._threads = [
            threading.Thread(target=self._follow_pose, daemon=True),
            threading.Thread(target=self._follow_map, daemon=True),
        ]

    def start(self) -> None:
        """Begin to ask."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop asking."""
        self._stopping.set()
        self._map_is_due.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(timeout=5.0)

    @property
    def mounted(self) -> bool:
        """Whether the service knows how the lidar sits: scans may follow."""
        return self._mounted.is_set()

    @property
    def component(self) -> str | None:
        """The component that the robot was in at the latest answer."""
        return self._component

    def offer_mount(self, mount: MountPose) -> None:
        """Have the service told how the lidar sits, as soon as it can be reached."""
        T = mount.T_base_laser
        self._mount = MountSettings(x=T.x, y=T.y, theta=T.theta, inverted=mount.inverted)

    def show_again(self) -> None:
        """Have grid and lines handed on anew, changed or not."""
        self._shown = None
        self._map_is_due.set()

    def ask_pose(self) -> None:
        """Tell the mount where that is due, ask for the robot's pose, hand on what is new."""
        if not self.mounted:
            if self._mount is None:
                return
            self._client.set_mount(self._site, self._robot, self._mount)
            self._mounted.set()
        robot = self._client.robot(self._site, self._robot)
        self._handlers.robot(robot)
        uses_odometry = self._settings.odometry != "none"
        found = map_transform(robot, self._feed, odometry=uses_odometry)
        if found is None:
            return
        if found.component != self._component:
            self._change_component(found.component)
        if found.seq != self._seq:
            self._seq = found.seq
            self._handlers.transform(found)

    def ask_map(self) -> None:
        """Ask for the map of the robot's component, where it has changed since."""
        component, wishes = self._component, self._settings
        if component is None or not (wishes.publish_grid or wishes.publish_lines):
            return
        answer = self._client.map(self._site, component=component)
        if (component, answer.version) == self._shown:
            return
        if wishes.publish_lines:
            self._handlers.lines(line_list(answer, component), component)
        if wishes.publish_grid:
            content = self._client.map_file(self._site, "nav2", component=component)
            self._handlers.grid(read_grid(content), component)
        self._shown = component, answer.version

    def _change_component(self, component: str) -> None:
        before, self._component = self._component, component
        merged = before is not None and before in self._client.site(self._site).merged_into
        self._handlers.component(ComponentChange(component, before, merged))
        self.show_again()

    def _follow_pose(self) -> None:
        while not self._stopping.wait(self._settings.pose_period):
            self._attempt("pose", self.ask_pose)

    def _follow_map(self) -> None:
        while not self._stopping.is_set():
            self._map_is_due.wait(self._settings.map_period)
            self._map_is_due.clear()
            if not self._stopping.is_set():
                self._attempt("map", self.ask_map)

    def _attempt(self, what: str, step: Callable[[], None]) -> None:
        try:
            step()
        except (LineloomError, GridError) as error:
            if what == "pose" and isinstance(error, NotFoundError):
                # The service forgot the robot, or has another database: it must be told anew.
                self._mounted.clear()
            self._handlers.trouble(what, str(error))
        else:
            self._handlers.trouble(what, "")
