"""What the soak calls growth, and that a service which leaks is seen."""

from __future__ import annotations

from tests.benchmarks.soak import _rows
from tests.benchmarks.soak_watch import Moment

MB = 1_000_000


def _moments(*api: int) -> list[Moment]:
    maps = (0, 10_000, 10_500)
    return [
        Moment(when, size, 0, {"API": rss * MB})
        for when, size, rss in zip(("start", "middle", "end"), maps, api, strict=True)
    ]


def test_memory_may_grow_while_the_building_is_got_to_know() -> None:
    (row,) = _rows(_moments(100, 120, 130), "")
    assert (row.figure, row.goal, row.reached) == (10.0, 10.0, True)


def test_memory_that_goes_on_growing_misses_the_goal() -> None:
    (row,) = _rows(_moments(100, 120, 131), "")
    assert row.reached is False


def test_memory_that_shrinks_is_fine() -> None:
    (row,) = _rows(_moments(100, 120, 110), "")
    assert row.reached is True
