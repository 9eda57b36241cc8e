"""One robot's bridge: scans in by way of a queue on disk; transforms, map and words out."""

from __future__ import annotations

import time
from typing import Any, Protocol

from lineloom.bridge.diagnosis import Observations, diagnose
from lineloom.bridge.lines import LineList
from lineloom.bridge.link import ComponentChange, Handlers, Link
from lineloom.bridge.localisation import MapTransform
from lineloom.bridge.messages import Messages
from lineloom.bridge.occupancy import Grid
from lineloom.bridge.odometry_track import OdometryTrack
from lineloom.bridge.planar import Planar, TiltedLidarError, mount, planar
from lineloom.bridge.scan_feed import ScanFeed
from lineloom.bridge.settings import BridgeSettings
from lineloom.bridge.stamps import nanoseconds
from lineloom.bridge.waiting_scans import WaitingScans
from lineloom.client import Client
from lineloom.errors import LineloomError
from lineloom.outbox import Outbox
from lineloom.retry import RetryPolicy
from lineloom.wire import Robot

_DIAGNOSED_EVERY_S = 1.0
_ASKED_WITHIN_S = 5.0
_WARNED_EVERY_S = 5.0


class NoTransformError(LookupError):
    """A transform is not known (yet)."""


class Ports(Protocol):
    """What carries the messages."""

    types: Any
    """The message classes, as `Messages` wants them."""

    def now(self) -> int:
        """Return the time that stamps are of [ns]."""

    def lookup(self, target: str, source: str, stamp: Any) -> Any:
        """Return a geometry_msgs/Transform at a stamp, or the latest where that is None.

        Raises NoTransformError.
        """

    def publish(self, topic: str, message: Any) -> None:
        """Send a message. Topics: tf, pose, map, map_metadata, map_lines, component, diagnostics.
        May be called by several threads."""

    def say(self, level: str, text: str) -> None:
        """Tell people; level: info or warn."""


class RobotBridge:
    """Takes messages as they come; `tick` is called some fifty times a second."""

    def __init__(self, settings: BridgeSettings, ports: Ports) -> None:
        self._settings, self._ports = settings, ports
        self._messages = Messages(ports.types, settings)
        token = settings.token or None
        self._sender = Client(settings.url or None, token=token)
        # A pose that comes late is none: who asks for it asks anew rather than waits.
        once = RetryPolicy(attempts=1)
        self._asker = Client(settings.url or None, token=token, retry=once, timeout=_ASKED_WITHIN_S)
        queue = settings.queue_file()
        queue.parent.mkdir(parents=True, exist_ok=True)
        self._outbox = Outbox(queue, self._sender, settings.site, settings.robot)
        self._feed = ScanFeed(self._outbox, settings.max_rate)
        self._waiting = WaitingScans(settings.transform_timeout)
        self._track = OdometryTrack()
        self.seen = Observations(began=time.monotonic())
        self._told_at = 0.0
        self._warned: dict[str, float] = {}
        handlers = Handlers(
            self._on_robot,
            self._on_transform,
            self._on_component,
            self._on_grid,
            self._on_lines,
            self._on_trouble,
        )
        self.link = Link(self._asker, settings, self._feed, handlers)

    def start(self) -> None:
        """Begin to deliver and to ask."""
        self._outbox.start()
        self.link.start()

    def close(self) -> None:
        """Stop asking; what was not delivered stays in the queue's file."""
        self.link.close()
        self._outbox.close()
        self._sender.close()
        self._asker.close()

    def on_odometry(self, message: Any) -> None:
        """Take a nav_msgs/Odometry."""
        frames = message.header.frame_id, message.child_frame_id
        wanted = self._settings.odom, self._settings.base
        if frames != wanted:
            self._warn("frames", f"odometry is of {frames}, the parameters say {wanted}")
        pose = message.pose.pose
        found = planar(pose.position, pose.orientation)
        self._track.put(nanoseconds(message.header.stamp), found)
        self._send_released()

    def on_scan(self, message: Any) -> None:
        """Take a sensor_msgs/LaserScan."""
        self.seen.scan_at = time.monotonic()
        self.seen.scans += 1
        if self.seen.paused or not self._feed.admits(message):
            return
        if not self.link.mounted:
            self._offer_mount(message.header.frame_id)
            return
        self._waiting.put(message, time.monotonic())
        self._send_released()

    def pause(self, paused: bool) -> None:
        """Leave scans out from now on, or no longer."""
        self.seen.paused = paused
        self._waiting.clear()

    def tick(self) -> None:
        """Send what has waited, and say how it goes once a second."""
        self._send_released()
        now = time.monotonic()
        if now - self._told_at >= _DIAGNOSED_EVERY_S:
            self._told_at = now
            found = diagnose(self.seen, self._outbox.stats(), now, self._settings.silent_after)
            message = self._messages.diagnosis(found, self._ports.now())
            self._ports.publish("diagnostics", message)

    def _send_released(self) -> None:
        if self._settings.odometry == "none":
            released = self._waiting.release(lambda _: Planar(), time.monotonic())
        else:
            released = self._waiting.release(self._odometry_at, time.monotonic())
        for scan in released:
            if scan.odometry is None:
                self._drop(scan.message)
                continue
            odometry = None if self._settings.odometry == "none" else scan.odometry
            try:
                self._feed.put(scan.message, odometry)
            except LineloomError as error:
                self._warn("scan", f"scan left out: {error}")

    def _drop(self, message: Any) -> None:
        self.seen.dropped += 1
        self.seen.dropped_at = time.monotonic()
        wanted = f"{self._settings.odom} -> {self._settings.base}"
        source = "topic odom" if self._settings.odometry == "topic" else "TF"
        stamp = nanoseconds(message.header.stamp)
        text = f"scan dropped: {source} does not have {wanted} at its time"
        within = f"{stamp * 1e-9:.3f} within {self._settings.transform_timeout:g} s"
        self._warn("dropped", f"{text} {within}; {self.seen.dropped} so far")

    def _odometry_at(self, message: Any) -> Planar | None:
        stamp = message.header.stamp
        if self._settings.odometry == "topic":
            return self._track.at(nanoseconds(stamp))
        try:
            found = self._ports.lookup(self._settings.odom, self._settings.base, stamp)
        except NoTransformError:
            return None
        return planar(found.translation, found.rotation)

    def _offer_mount(self, laser_frame: str) -> None:
        """Have the service told how the lidar sits; no scan goes out before it knows."""
        try:
            found = self._ports.lookup(self._settings.base, laser_frame, None)
            self.link.offer_mount(mount(found.translation, found.rotation))
            self.seen.hindrance = ""
        except (NoTransformError, TiltedLidarError) as error:
            self.seen.hindrance = f"no scans are sent: {error}"
            self._warn("mount", f"no scans yet: {error}")

    def _warn(self, kind: str, text: str) -> None:
        """Warn, of each kind once in some seconds."""
        now = time.monotonic()
        if now - self._warned.get(kind, -_WARNED_EVERY_S) >= _WARNED_EVERY_S:
            self._warned[kind] = now
            self._ports.say("warn", text)

    def _on_robot(self, robot: Robot) -> None:
        self.seen.robot = robot

    def _on_transform(self, found: MapTransform) -> None:
        self.seen.placed, self.seen.placed_at = found, time.monotonic()
        if self._settings.publish_tf:
            self._ports.publish("tf", self._messages.transform(found))
        self._ports.publish("pose", self._messages.pose(found))

    def _on_component(self, change: ComponentChange) -> None:
        self._ports.publish("component", self._messages.component(change))
        if change.merged:
            text = f"{change.before} was joined to {change.component}: the map is that one's now"
            self._ports.say("info", text)
        elif change.before is not None:
            self._ports.say("info", f"the map is {change.component}'s now, not {change.before}'s")

    def _on_grid(self, grid: Grid, component: str) -> None:
        now = self._ports.now()
        self._ports.publish("map", self._messages.grid(grid, component, now))
        self._ports.publish("map_metadata", self._messages.metadata(grid, now))

    def _on_lines(self, lines: LineList, component: str) -> None:
        message = self._messages.lines(lines, component, self._ports.now())
        self._ports.publish("map_lines", message)

    def _on_trouble(self, what: str, text: str) -> None:
        before = self.seen.trouble.get(what, "")
        self.seen.trouble[what] = text
        if text and text != before:
            self._ports.say("warn", text)
        elif before and not text:
            self._ports.say("info", f"the service gives the {what} again")
