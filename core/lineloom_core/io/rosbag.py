"""Bags of ROS 1 and ROS 2 (SQLite and MCAP), and lone MCAP files, by `rosbags`: ROS not needed.

Every topic of `sensor_msgs/LaserScan` is a robot of its own. Static transforms tell how its lidar
sits on the base; odometry, where there is any, comes from `nav_msgs/Odometry` of the same
namespace, else from the transform of the base in the `odom` frame.
"""

from __future__ import annotations

import math
import sqlite3
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError

from lineloom_core.geometry import Pose
from lineloom_core.io.bag_index import opened
from lineloom_core.io.odometry_track import OdometryTrack
from lineloom_core.io.salvage import Salvaged
from lineloom_core.io.salvage_bag import parts_of, salvaged
from lineloom_core.io.static_transforms import StaticTransforms, planar
from lineloom_core.scan import InvalidScanError, Mount, Scan

_SCAN = "sensor_msgs/msg/LaserScan"
_SCANS = (_SCAN, "foxglove.LaserScan")
_BASE = "base_link"
_ODOMETRY = "nav_msgs/msg/Odometry"
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_STATIC_TOPIC = "tf_static"


class RosbagError(ValueError):
    """A bag that cannot be read, or has not what was asked for; the text says what there is."""


class _NoScansError(RosbagError):
    """No topic has scans, as far as `rosbags` sees."""


_DAMAGED = (AnyReaderError, AssertionError, struct.error, sqlite3.Error, EOFError, RuntimeError)
"""What `rosbags` raises on a file that is cut or has no index."""


@dataclass(frozen=True)
class BagOptions:
    """topics: of the scans; all there are, if none is named. base_frame, odom_frame: names of
    frames, also behind a prefix ("r1/base_link"); a base_frame that is asked for has to be there,
    None is "base_link" where there is one. odometry_topic: for all robots, where their own
    namespace has none."""

    topics: tuple[str, ...] = ()
    base_frame: str | None = None
    odom_frame: str = "odom"
    odometry_topic: str | None = None


@dataclass(frozen=True)
class BagRobot:
    """One topic's scans in the order of the recording. name: from the topic, "" for "/scan".
    mount: None where no static transforms tell. refused: what was left out, and why."""

    topic: str
    name: str
    mount: Mount | None
    scans: tuple[Scan, ...]
    refused: tuple[str, ...] = ()


@dataclass
class _Gathered:
    """What one pass over the bag finds."""

    scans: dict[str, list[Any]] = field(default_factory=dict)
    odometry: dict[str, OdometryTrack] = field(default_factory=dict)
    static: StaticTransforms = field(default_factory=StaticTransforms)
    moving: dict[tuple[str, str], OdometryTrack] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)


def read_bag(path: str | Path, options: BagOptions | None = None) -> tuple[BagRobot, ...]:
    """Return the robots of a bag. Raises RosbagError, OSError."""
    chosen = options or BagOptions()
    source = Path(path)
    try:
        with opened(source) as reader:
            found = _gather(reader, _scan_topics(reader, chosen, source))
    except _NoScansError as nothing:
        # Messages that are JSON are not for rosbags.
        found = _salvaged(source, chosen, nothing)
    except _DAMAGED as error:
        found = _salvaged(source, chosen, error)
    except FileNotFoundError as error:
        if not (source.is_dir() and parts_of(source)):
            raise
        found = _salvaged(source, chosen, error)
    _check_base(found, chosen, source)
    apart = _share_transforms(found, chosen)
    return tuple(_robot(topic, found, chosen, apart) for topic in found.scans)


def _salvaged(source: Path, options: BagOptions, error: Exception) -> _Gathered:
    """Read a bag that `rosbags` cannot read, as far as it goes."""
    try:
        reader = salvaged(source)
    except ValueError as nothing:
        if isinstance(error, RosbagError):
            raise error from None
        said = f"{source}: not a bag that can be read: {error or type(error).__name__}; {nothing}"
        raise RosbagError(said) from None
    found = _gather(reader, _scan_topics(reader, options, source))
    if not isinstance(error, RosbagError):
        scans = sum(len(messages) for messages in found.scans.values())
        why = str(error) or type(error).__name__
        lost = reader.lost or f"nothing; it was read without its index or metadata ({why})"
        found.lost.insert(0, f"{lost}; {scans} scans could be read")
    return found


def is_bag(path: Path) -> bool:
    """Tell by its name whether a path is a bag: .bag, .mcap, .db3, or a folder with such files."""
    return (path.is_dir() and (path / "metadata.yaml").exists()) or bool(parts_of(path))


def _scan_topics(reader: AnyReader | Salvaged, options: BagOptions, source: Path) -> set[str]:
    there = sorted({c.topic for c in reader.connections if c.msgtype in _SCANS})
    others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections}))
    if not there:
        raise _NoScansError(f"{source}: no topic has laser scans; it has: {others or 'nothing'}")
    missing = [topic for topic in options.topics if topic not in there]
    if missing:
        known = ", ".join(there)
        raise RosbagError(f"{source}: no laser scans on {missing[0]}; they are on: {known}")
    return set(options.topics or there)


def _gather(reader: AnyReader | Salvaged, topics: set[str]) -> _Gathered:
    found = _Gathered({topic: [] for topic in sorted(topics)})
    wanted = [
        c
        for c in reader.connections
        if (c.msgtype in _SCANS and c.topic in topics) or c.msgtype in (_ODOMETRY, *_TRANSFORMS)
    ]
    messages: Any = reader.messages
    for connection, _, raw in messages(connections=wanted):
        try:
            message: Any = reader.deserialize(raw, connection.msgtype)
        except Exception as error:  # whatever a damaged message makes of its reader
            found.lost.append(f"{connection.topic}: a message cannot be read: {error}")
            continue
        if connection.msgtype in _SCANS:
            found.scans[connection.topic].append(message)
        elif connection.msgtype == _ODOMETRY:
            track = found.odometry.setdefault(connection.topic, OdometryTrack())
            track.add(_stamp(message), planar(message.pose.pose))
        else:
            _take_transforms(found, message, connection.topic.endswith(_STATIC_TOPIC))
    return found


def _take_transforms(found: _Gathered, message: Any, static: bool) -> None:
    for transform in message.transforms:
        parent = transform.header.frame_id.lstrip("/")
        child = transform.child_frame_id.lstrip("/")
        if static:
            found.static.add(parent, child, transform.transform)
        else:
            track = found.moving.setdefault((parent, child), OdometryTrack())
            track.add(_stamp(transform), planar(transform.transform))


def _check_base(found: _Gathered, options: BagOptions, source: Path) -> None:
    """Raise RosbagError where the base frame that was asked for is in no transform."""
    base = options.base_frame
    frames = found.static.frames | {frame for pair in found.moving for frame in pair}
    if base is not None and not any(f == base or f.endswith("/" + base) for f in frames):
        known = ", ".join(sorted(frames)) or "there are no transforms"
        raise RosbagError(f"{source}: no transform has the base frame {base!r}; frames: {known}")


def _share_transforms(found: _Gathered, options: BagOptions) -> dict[str, str]:
    """Return the topics whose odometry would be that of several robots in one, and what to say."""
    by_key: dict[tuple[str, str], list[str]] = {}
    for topic in found.scans:
        by_key.setdefault(_moving_key(_frame(found, topic), options), []).append(topic)
    said: dict[str, str] = {}
    for (odom, base), topics in by_key.items():
        if len({topic.strip("/").partition("/")[0] for topic in topics if "/" in topic[1:]}) > 1:
            text = (
                f"the transforms of {', '.join(topics)} have no prefix for each robot: {odom!r} to "
                f"{base!r} is all of them in one, and no odometry is taken from it; play each "
                "robot's recording by itself, or give frames a prefix"
            )
            said |= dict.fromkeys(topics, text) if (odom, base) in found.moving else {}
    return said


def _frame(found: _Gathered, topic: str) -> str:
    messages = found.scans[topic]
    return messages[0].header.frame_id.lstrip("/") if messages else ""


def _robot(topic: str, found: _Gathered, options: BagOptions, apart: dict[str, str]) -> BagRobot:
    messages = found.scans[topic]
    frame = _frame(found, topic)
    odometry = _odometry(topic, frame, found, options)
    scans: list[Scan] = []
    refused: list[str] = list(found.lost)
    if topic in apart and odometry is found.moving.get(_moving_key(frame, options)):
        odometry = None
        refused.insert(0, apart[topic])
    for number, message in enumerate(messages):
        stamp = _stamp(message)
        pose = None if odometry is None else odometry.at(stamp)
        try:
            scans.append(_scan(message, stamp, len(scans), pose))
        except InvalidScanError as error:
            refused.append(f"{topic}, message {number}: {error}")
    mount = found.static.mount(options.base_frame or _BASE, frame)
    return BagRobot(topic, robot_name(topic), mount, tuple(scans), tuple(refused))


def robot_name(topic: str) -> str:
    """Return a robot's name from its topic: `/r1/scan` is "r1", `/scan` is "" (the file's)."""
    parts = [part for part in topic.split("/") if part]
    if parts and parts[-1] in ("scan", "laser_scan", "base_scan"):
        parts = parts[:-1]
    return "-".join(parts)


def _odometry(
    topic: str, frame: str, found: _Gathered, options: BagOptions
) -> OdometryTrack | None:
    """Return the odometry that belongs to a scan topic, None where it is not plain which."""
    if options.odometry_topic is not None:
        return found.odometry.get(options.odometry_topic)
    space = topic.rsplit("/", 1)[0]
    own = [t for name, t in found.odometry.items() if name.rsplit("/", 1)[0] == space]
    if len(own) == 1:
        return own[0]
    return found.moving.get(_moving_key(frame, options))


def _moving_key(frame: str, options: BagOptions) -> tuple[str, str]:
    """Return which transform says where the base of a lidar's frame is in its odom frame."""
    prefix = frame.rsplit("/", 1)[0] + "/" if "/" in frame else ""
    return prefix + options.odom_frame, prefix + (options.base_frame or _BASE)


def _scan(message: Any, stamp: float, seq: int, odometry: Pose | None) -> Scan:
    return Scan.checked(
        np.asarray(message.ranges, dtype=np.float64),
        angle_min=float(message.angle_min),
        angle_increment=_increment(message),
        range_min=float(message.range_min),
        range_max=float(message.range_max),
        stamp=stamp,
        seq=seq,
        time_increment=max(0.0, float(message.time_increment)),
        scan_time=max(0.0, float(message.scan_time)),
        odometry=odometry,
    )


def _increment(message: Any) -> float:
    """Return the increment; over a thousand beams its rounding to float32 is felt, so it is taken
    from both ends where they agree."""
    beams, told = len(message.ranges), float(message.angle_increment)
    if beams > 1:
        between = (float(message.angle_max) - float(message.angle_min)) / (beams - 1)
        if math.isclose(between, told, rel_tol=1e-4):
            return between
    return told


def _stamp(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)
