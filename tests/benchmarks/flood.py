"""A flood of scans: `python -m tests.benchmarks.flood HOST PORT SITE CONNECTIONS`, until killed.

Single-scan POSTs of 361 beams in msgpack over so many connections, each sending the next as soon as
the last is answered. Requests are made beforehand and answers hardly looked at: the load is the
service's, not the sender's. Prints how many were answered 202 and 429, once a second.
"""

from __future__ import annotations

import asyncio
import math
import struct
import sys
import time
from collections import Counter
from itertools import count

from lineloom.wire import MSGPACK, Scan, pack_msgpack

BEAMS = 361
_MARK = 0x7ABBCCDD
_PAUSE_S = 0.05
"""Where the backlog is full."""


def room(phase: float) -> list[float]:
    """Ranges of a robot that turns in a square room of 8 m."""
    angles = (phase + math.radians(0.5 * beam) for beam in range(BEAMS))
    return [4.0 / max(abs(math.cos(a)), abs(math.sin(a))) for a in angles]


def bodies() -> list[bytes]:
    """Scans of a robot that turns once around, packed, with a mark where `seq` belongs."""
    return [
        pack_msgpack(
            [
                Scan(
                    seq=_MARK,
                    stamp=0.0,
                    angle_min=0.0,
                    angle_increment=math.radians(0.5),
                    range_min=0.1,
                    range_max=30.0,
                    ranges=room(0.1 * step),
                )
            ]
        )
        for step in range(63)
    ]


async def robot(
    host: str, port: int, site: str, name: str, packed: list[bytes], seen: Counter[int]
) -> None:
    """Send one robot's scans."""
    reader, writer = await asyncio.open_connection(host, port)
    length = len(packed[0])
    head = (
        f"POST /v1/sites/{site}/robots/{name}/scans HTTP/1.1\r\nHost: x\r\n"
        f"Content-Type: {MSGPACK}\r\nContent-Length: {length}\r\n\r\n"
    ).encode()
    mark = struct.pack(">I", _MARK)
    for seq in count():
        body = packed[seq % len(packed)].replace(mark, struct.pack(">I", seq))
        status = 429
        while status == 429:
            writer.write(head + body)
            status = await _status(reader)
            seen[status] += 1
            if status == 429:
                await asyncio.sleep(_PAUSE_S)


async def _status(reader: asyncio.StreamReader) -> int:
    head = await reader.readuntil(b"\r\n\r\n")
    length = int(head.lower().partition(b"content-length:")[2].partition(b"\r\n")[0])
    await reader.readexactly(length)
    return int(head.split(b" ", 2)[1])


async def main(host: str, port: int, site: str, connections: int) -> None:
    """Flood."""
    seen: Counter[int] = Counter()
    names = (f"robot-{number}" for number in range(connections))
    packed = bodies()
    tasks = [asyncio.create_task(robot(host, port, site, name, packed, seen)) for name in names]
    while not any(task.done() for task in tasks):
        await asyncio.sleep(1.0)
        print(f"{time.monotonic():.1f} {seen[202]} {seen[429]}", flush=True)
    await asyncio.gather(*tasks)


if __name__ == "__main__":
    address, at, where, many = sys.argv[1:]
    asyncio.run(main(address, int(at), where, int(many)))
