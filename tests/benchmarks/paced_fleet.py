"""Robots that send at their own pace, whether the service keeps up or not."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

from lineloom.wire import MSGPACK, pack_msgpack
from lineloom.wire import Scan as WireScan
from lineloom_core.scan import Scan
from lineloom_lab.simulation import Fleet, office_floor, scanner_360

_SEED = 4
_SHORTEST_PAUSE_S = 0.05


@dataclass(frozen=True, slots=True)
class Post:
    """What one robot saw in a while. at_s: when its last scan was taken, from the beginning."""

    at_s: float
    seq: int
    body: bytes


def drives(
    robots: int, *, rate_hz: float, seconds: float, beams: int, batch: int
) -> list[list[Post]]:
    """Simulate so many robots on one office floor; what each of them sends, in batches."""
    lidar = replace(scanner_360(), angle_increment=math.tau / beams, beams=beams, rate_hz=rate_hz)
    fleet = Fleet.touring(
        office_floor(_SEED), robots=robots, seed=_SEED, duration_s=seconds, lidar=lidar
    )
    found = []
    for robot in fleet.robots:
        seen = [(simulated.time_s, simulated.scan) for simulated in robot.scans()]
        cuts = range(0, len(seen) - batch + 1, batch)
        found.append([_post(seen[k : k + batch]) for k in cuts])
    return found


def _post(seen: Sequence[tuple[float, Scan]]) -> Post:
    at_s, last = seen[-1]
    return Post(at_s, last.seq, pack_msgpack([_wire(scan) for _, scan in seen]))


def _wire(scan: Scan) -> WireScan:
    return WireScan(
        seq=scan.seq,
        stamp=scan.stamp,
        angle_min=scan.angle_min,
        angle_increment=scan.angle_increment,
        range_min=scan.range_min,
        range_max=scan.range_max,
        ranges=scan.ranges.tolist(),
    )


@dataclass
class PacedFleet:
    """Every site's robots, each on a connection of its own, on a thread; ends with the block.

    sites: by name, what its robots send. sent: by site and robot, when which scan was sent last,
    as (seq, monotonic time), oldest first. answers: how many of each status.
    """

    port: int
    sites: dict[str, list[list[Post]]]
    sent: dict[tuple[str, str], list[tuple[int, float]]] = field(default_factory=dict)
    answers: Counter[int] = field(default_factory=Counter)

    def __enter__(self) -> Self:
        for site, robots in self.sites.items():
            self.sent |= {(site, f"robot-{k}"): [] for k in range(len(robots))}
        self._over = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._drive()))
        self._thread.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._over.set()
        self._thread.join()

    def age_s(self, site: str, robot: str, seq: int | None, now: float) -> float | None:
        """How long ago the first scan after `seq` was sent, 0 if none was; None: none ever."""
        sent = self.sent[site, robot]
        if not sent:
            return None
        later = (at for number, at in sent if seq is None or number > seq)
        return now - next(later, now)

    async def _drive(self) -> None:
        begin = time.monotonic() + 1.0
        async with asyncio.TaskGroup() as group:
            for site, robots in self.sites.items():
                for k, posts in enumerate(robots):
                    group.create_task(self._send(site, f"robot-{k}", posts, begin))

    async def _send(self, site: str, robot: str, posts: list[Post], begin: float) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        path = f"/v1/sites/{site}/robots/{robot}/scans"
        for post in posts:
            await asyncio.sleep(max(0.0, begin + post.at_s - time.monotonic()))
            self.sent[site, robot].append((post.seq, time.monotonic()))
            head = (
                f"POST {path} HTTP/1.1\r\nHost: x\r\nContent-Type: {MSGPACK}\r\n"
                f"Content-Length: {len(post.body)}\r\n\r\n"
            )
            status = 0
            while status != 202 and not self._over.is_set():
                writer.write(head.encode() + post.body)
                status = await _status(reader)
                self.answers[status] += 1
                if status != 202:
                    await asyncio.sleep(_SHORTEST_PAUSE_S)
            if self._over.is_set():
                break
        writer.close()


async def _status(reader: asyncio.StreamReader) -> int:
    head = await reader.readuntil(b"\r\n\r\n")
    length = int(head.lower().partition(b"content-length:")[2].partition(b"\r\n")[0])
    await reader.readexactly(length)
    return int(head.split(b" ", 2)[1])
