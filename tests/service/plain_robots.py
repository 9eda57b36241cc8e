"""Robots that send plain scans to a real server, one after another, until it is gone."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

import httpx

Stream = tuple[str, str]
"""A site and a robot of it."""

Scans = Callable[[int], dict[str, Any]]
"""The body of the scan with a `seq`."""


def plain_scan(seq: int) -> dict[str, Any]:
    """A scan of 20 beams as JSON has it; time goes round, as `seq` does not."""
    return {
        "seq": seq,
        "stamp": float(seq % 500),
        "angle_min": -1.0,
        "angle_increment": 0.1,
        "range_min": 0.1,
        "range_max": 30.0,
        "ranges": [1.0 + 0.01 * (seq % 97)] * 20,
    }


async def drive(
    port: int,
    streams: Iterable[Stream],
    acknowledged: dict[Stream, int],
    *,
    scan: Scans = plain_scan,
    goal: int | None = None,
    pause_s: float = 0.0,
) -> None:
    """Have every robot send scan after scan, each until it is acknowledged.

    Until the server is gone, or `goal` scans of each are. acknowledged: how many are, counted on.
    """

    async def robot(stream: Stream, client: httpx.AsyncClient) -> None:
        site, name = stream
        url = f"http://127.0.0.1:{port}/v1/sites/{site}/robots/{name}/scans"
        while goal is None or acknowledged[stream] < goal:
            try:
                response = await client.post(url, json=scan(acknowledged[stream]))
            except httpx.TransportError:
                return
            assert response.status_code == 202, response.text
            acknowledged[stream] += 1
            await asyncio.sleep(pause_s)

    async with httpx.AsyncClient(timeout=60.0) as client:
        await asyncio.gather(*(robot(stream, client) for stream in streams))
