"""Recordings as robots: what `replay` plays, from one file or several."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lineloom.cli.console import note
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.scan_files import formats, read_scans
from lineloom.cli.schedule import Stream, robot_name, split
from lineloom.scan_like import to_wire
from lineloom.wire import MountSettings, Scan

if TYPE_CHECKING:
    from lineloom_core.io.rosbag import BagOptions, BagRobot
    from lineloom_core.scan import Mount

_BAG_SUFFIXES = {".bag", ".mcap", ".db3"}


@dataclass(frozen=True)
class BagChoice:
    """What to take from bags: see `lineloom_core.io.rosbag.BagOptions`."""

    topics: tuple[str, ...] = ()
    base_frame: str | None = None
    odom_frame: str = "odom"
    odometry_topic: str | None = None


def load(
    logs: Sequence[Path],
    *,
    split_into: int = 1,
    robot: str | None = None,
    odometry: bool = True,
    bags: BagChoice | None = None,
) -> list[Stream]:
    """Read recordings into one stream per robot, or end the command with what is wrong."""
    streams: list[Stream] = []
    for index, path in enumerate(logs):
        own = robot if robot is None or len(logs) == 1 else f"{robot}-{index + 1}"
        if _is_bag(path):
            found = _bag_streams(path, own, bags or BagChoice())
        else:
            found = _streams(path, own)
        for stream in found:
            streams += split(stream if odometry else _without_odometry(stream), split_into)
    names = [stream.robot for stream in streams]
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise CommandError(
            f"two logs are named {doubled[0]}: name the robots with --robot", Exit.USAGE
        )
    return streams


def _is_bag(path: Path) -> bool:
    return path.is_dir() or path.suffix.lower() in _BAG_SUFFIXES


def _streams(path: Path, robot: str | None) -> list[Stream]:
    scans: dict[str, list[Scan]] = {}
    session = _session(path)
    own = robot or robot_name(_stem(path))
    several = False
    for found in read_scans(path):
        scan = to_wire(found.scan)
        if scan.session == "0":
            scan = to_wire(scan, session=session)
        several = several or found.robot is not None
        part = scans.setdefault(found.robot or own, [])
        # By its place in the file: played again, it is the same scan.
        part.append(scan if scan.seq is not None else to_wire(scan, seq=len(part)))
    if not scans:
        raise CommandError(f"{path} holds no scans that are known. Read are {formats()}")
    if robot is not None and several:
        # The log's own names would be lost: they become endings.
        return [Stream(f"{robot}-{name}", list(part)) for name, part in scans.items()]
    return [Stream(name, part) for name, part in scans.items()]


def _bag_streams(path: Path, robot: str | None, choice: BagChoice) -> list[Stream]:
    """Read a bag: a robot per topic, named after the topic, or the file where that says nothing."""
    robots = _read_bag(path, choice)
    session = _session(path)
    own = robot or robot_name(_stem(path))
    streams = []
    for found in robots:
        for reason in found.refused[:3]:
            note(f"{path}: left out: {reason}")
        if len(found.refused) > 3:
            note(f"{path}: left out: {len(found.refused) - 3} more")
        if not found.scans:
            note(f"{path}: {found.topic} holds no scan that can be used")
            continue
        if robot is None:
            name = robot_name(found.name) if found.name else own
        else:
            name = own if len(robots) == 1 else f"{own}-{robot_name(found.name or found.topic)}"
        scans = [to_wire(scan, session=session) for scan in found.scans]
        streams.append(Stream(name, scans, _mount(found.mount)))
    if not streams:
        raise CommandError(f"{path} holds no scans that can be used")
    return streams


def _read_bag(path: Path, choice: BagChoice) -> tuple[BagRobot, ...]:
    try:
        from lineloom_core.io.rosbag import RosbagError, is_bag, read_bag
        from lineloom_core.io.static_transforms import TiltedLidarError
    except ImportError:
        raise CommandError(
            f"{path}: reading bags needs the core: `pip install lineloom-client[server]`"
        ) from None
    if not path.exists():
        raise CommandError(f"{path}: No such file or directory")
    if not is_bag(path):
        raise CommandError(f"{path} is a folder, but no bag of ROS 2: it has no .mcap or .db3")
    try:
        return read_bag(path, _options(choice))
    except (RosbagError, TiltedLidarError) as error:
        raise CommandError(str(error)) from None


def _options(choice: BagChoice) -> BagOptions:
    from lineloom_core.io.rosbag import BagOptions

    return BagOptions(
        topics=choice.topics,
        base_frame=choice.base_frame,
        odom_frame=choice.odom_frame,
        odometry_topic=choice.odometry_topic,
    )


def _mount(mount: Mount | None) -> MountSettings | None:
    if mount is None:
        return None
    T = mount.T_base_laser
    return MountSettings(x=T.x, y=T.y, theta=T.theta, inverted=mount.inverted)


def _without_odometry(stream: Stream) -> Stream:
    bare = [scan.model_copy(update={"odometry": None}) for scan in stream.scans]
    return Stream(stream.robot, bare, stream.mount)


def _stem(path: Path) -> str:
    """Return a file's name without its endings: `run.log.gz` is `run`."""
    return path.name.removesuffix(".gz").rsplit(".", 1)[0] if "." in path.name else path.name


def _session(path: Path) -> str:
    """Return a session that is the log's own: again the same, and never another log's."""
    if not path.is_dir():
        return f"log-{_digest(path)}"
    files = sorted(file for file in path.rglob("*") if file.is_file())
    joined = "".join(_digest(file) for file in files)
    return f"log-{hashlib.blake2b(joined.encode()).hexdigest()[:12]}"


def _digest(path: Path) -> str:
    digest = hashlib.blake2b()
    with path.open("rb") as content:
        while block := content.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()[:12]
