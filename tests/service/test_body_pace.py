"""Which senders are slow: those behind the rate by more than the patience, and no others."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

import pytest
from lineloom_service.body_pace import take_paced
from lineloom_service.errors import SLOW_BODY, ProblemError

from tests.service.virtual_time import VirtualTimeLoop

PATIENCE_S = 20.0
RATE = 1000.0
Part = tuple[float, int]


async def _sent(parts: Iterable[Part]) -> AsyncIterator[bytes]:
    """Parts of so many bytes, each after a pause [s]."""
    for pause, size in parts:
        await asyncio.sleep(pause)
        yield bytes(size)


async def _read(parts: Iterable[Part]) -> tuple[int, float]:
    taken: list[bytes] = []
    await take_paced(_sent(parts), PATIENCE_S, RATE, taken.append)
    return sum(map(len, taken)), asyncio.get_running_loop().time()


def read(parts: Iterable[Part]) -> tuple[int, float]:
    """Return how much was read, and when that was done [s]."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(_read(parts))


def expect_slow(parts: Iterable[Part]) -> None:
    with pytest.raises(ProblemError) as raised:
        read(parts)
    assert raised.value.kind is SLOW_BODY
    assert raised.value.headers == {"Connection": "close"}


def test_a_pause_may_be_as_long_as_the_patience() -> None:
    assert read([(0.0, 50_000), (19.9, 50_000), (19.9, 1)])[0] == 100_001
    expect_slow([(0.0, 50_000), (20.1, 1)])


def test_what_was_quick_before_buys_no_longer_pause() -> None:
    expect_slow([(0.0, 16_000_000), (20.1, 1)])


def test_a_link_at_the_rate_may_take_hours() -> None:
    size, seconds = read([(2.0, 2_100)] * 7_000)
    assert size == 14_700_000
    assert seconds == pytest.approx(14_000.0)


def test_bursts_count_by_what_they_bring() -> None:
    assert read([(15.0, 15_000)] * 100)[0] == 1_500_000


def test_a_link_below_the_rate_ends_when_it_is_too_far_behind() -> None:
    # Half a second more behind in each second.
    assert read([(1.0, 500)] * 38)[0] == 19_000
    expect_slow([(1.0, 500)] * 40)


def test_a_byte_now_and_then_is_no_progress() -> None:
    expect_slow([(1.0, 1)] * 25)


def test_who_never_sends_is_slow() -> None:
    expect_slow([(1e9, 1)])
