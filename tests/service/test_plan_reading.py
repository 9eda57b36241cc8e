"""Drawings that are small to send and have no end: refused in time, and nobody waits for it."""

from __future__ import annotations

import asyncio
import io
import math
import time
from collections.abc import Callable
from typing import Any

import ezdxf
import pytest
from lineloom_core.floorplan.plan import FloorPlanError
from lineloom_service.plan_reading import Limits, PlanReader


def _drawing(draw: Callable[[Any], None]) -> bytes:
    document = ezdxf.new()  # type: ignore[attr-defined]
    draw(document)
    text = io.StringIO()
    document.write(text)
    return text.getvalue().encode()


def _array_of_blocks(document: Any) -> None:
    block = document.blocks.new("b")
    block.add_line((0, 0), (1, 0))
    insert = document.modelspace().add_blockref("b", (0, 0))
    insert.dxf.row_count = insert.dxf.column_count = 30_000
    insert.dxf.row_spacing = insert.dxf.column_spacing = 2.0


def _blocks_within_blocks(document: Any) -> None:
    below = document.blocks.new("b0")
    below.add_line((0, 0), (0, 0))
    for level in range(1, 12):
        block = document.blocks.new(f"b{level}")
        for _ in range(10):
            block.add_blockref(f"b{level - 1}", (0, 0))
    document.modelspace().add_blockref("b11", (0, 0))


def _huge_circle(document: Any) -> None:
    document.modelspace().add_circle((0, 0), 1e15)


def _huge_spline(document: Any) -> None:
    points = [(1e12 * math.sin(i), 1e12 * math.cos(2 * i)) for i in range(200)]
    document.modelspace().add_spline(points)


BOMBS = [_array_of_blocks, _blocks_within_blocks, _huge_circle, _huge_spline]


async def _read(draw: Callable[[Any], None], limits: Limits) -> tuple[int, str]:
    """Return how many lines a drawing has, or why it cannot be read."""
    try:
        plan = await PlanReader(limits).read(_drawing(draw), "dxf")
    except FloorPlanError as error:
        return 0, str(error)
    return len(plan.lines), ""


async def _longest_wait(until: asyncio.Future[Any]) -> float:
    longest = 0.0
    while not until.done():
        begin = time.monotonic()
        await asyncio.sleep(0.01)
        longest = max(longest, time.monotonic() - begin)
    return longest


@pytest.mark.long
@pytest.mark.parametrize("draw", BOMBS)
async def test_a_drawing_without_end_is_refused(draw: Callable[[Any], None]) -> None:
    reading = asyncio.ensure_future(_read(draw, Limits()))
    assert await _longest_wait(reading) < 1.0
    lines, reason = await reading
    assert lines == 0
    assert reason.startswith(("takes more than", "holds more than 200000", "is no DXF"))


async def test_limits_of_cpu_and_of_memory() -> None:
    found = await asyncio.gather(
        _read(_blocks_within_blocks, Limits(cpu_s=4)),
        _read(_huge_circle, Limits(memory=300 * 2**20)),
        _read(_room, Limits(wall_s=0.01)),
    )
    assert [lines for lines, _ in found] == [0, 0, 0]
    for _, reason in found:
        assert "takes more than" in reason or "Unable to allocate" in reason


async def test_what_can_be_read_is() -> None:
    lines, reason = await _read(_room, Limits())
    assert (lines, reason) == (4, "")
    with pytest.raises(FloorPlanError, match="line 1: expected four numbers"):
        await PlanReader().read(b"0, 0, 1", "text")


def _room(document: Any) -> None:
    document.modelspace().add_lwpolyline([(0, 0), (8, 0), (8, 5), (0, 5)], close=True)
