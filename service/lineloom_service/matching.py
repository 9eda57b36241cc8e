"""Pairwise matches for `POST /v1/match`: in this process, one at a time, off the event loop."""

from __future__ import annotations

import asyncio
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from lineloom_core.matching import LineMatcher, MatchResult
from lineloom_core.scan import Scan


class PairMatcher:
    """A matcher of its own thread. A match takes well under a millisecond once it is warm."""

    def __init__(self) -> None:
        self._matcher = LineMatcher()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="lineloom-match")
        self._warm = False

    def not_ready(self) -> list[str]:
        """Return what is missing before a match is quick."""
        return [] if self._warm else ["the matcher is warming up"]

    async def warm_up(self) -> None:
        """Compile the matcher's kernels, or load them from the cache."""
        scan = _square_room()
        await self.match(scan, scan)
        self._warm = True

    async def match(self, reference: Scan, current: Scan) -> MatchResult:
        """Find T_reference_current."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, self._matcher.match, reference, current)

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)


def _square_room() -> Scan:
    """A half-turn sweep from the middle of a room of 8 m by 8 m."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    ranges = 4.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    return Scan.checked(
        ranges,
        angle_min=float(angles[0]),
        angle_increment=float(angles[1] - angles[0]),
        range_min=0.05,
        range_max=30.0,
        stamp=0.0,
    )
