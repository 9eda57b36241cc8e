"""Who plays which scans when: one log as several robots, several logs at the same time."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lineloom.scan_like import to_wire
from lineloom.wire import MountSettings, Scan

_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9._-]+")


@dataclass(frozen=True)
class Stream:
    """The scans of one robot in their order; stamps as recorded. mount: where the log tells."""

    robot: str
    scans: Sequence[Scan]
    mount: MountSettings | None = None

    @property
    def duration(self) -> float:
        """Seconds from the earliest to the latest stamp."""
        stamps = [scan.stamp for scan in self.scans]
        return max(stamps) - min(stamps) if stamps else 0.0


@dataclass(frozen=True, slots=True)
class Due:
    """A scan, and when it is due: seconds after the start of the play."""

    at: float
    robot: str
    scan: Scan


def split(stream: Stream, parts: int) -> list[Stream]:
    """Cut a stream by time into consecutive parts, each a robot of its own that counts from 0.

    Real stamps step back at times: a scan belongs to the part that the latest stamp so far has
    reached, so that every part is a piece of the log without holes.
    """
    if parts == 1:
        return [stream]
    begin = stream.scans[0].stamp
    latest = begin
    cuts: list[list[Scan]] = [[] for _ in range(parts)]
    for scan in stream.scans:
        latest = max(latest, scan.stamp)
        share = (latest - begin) / stream.duration if stream.duration > 0.0 else 0.0
        index = min(int(share * parts), parts - 1)
        part = cuts[index]
        session = f"{scan.session}.{index + 1}of{parts}"
        part.append(to_wire(scan, seq=len(part), session=session))
    return [
        Stream(f"{stream.robot}-{index + 1}", cut, stream.mount)
        for index, cut in enumerate(cuts)
        if cut
    ]


def together(streams: Sequence[Stream]) -> Iterator[Due]:
    """Interleave streams as robots that set out at the same time; each keeps its own order."""
    yield from heapq.merge(*map(_due, streams), key=lambda due: due.at)


def robot_name(text: str) -> str:
    """Return a name that the contract allows, made from a file's name."""
    name = _NOT_IN_NAMES.sub("-", text).strip("._-")[:64]
    return name or "robot"


def _due(stream: Stream) -> Iterator[Due]:
    latest = stream.scans[0].stamp if stream.scans else 0.0
    begin = latest
    for scan in stream.scans:
        latest = max(latest, scan.stamp)
        yield Due(latest - begin, stream.robot, scan)
