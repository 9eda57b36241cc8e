"""Sites that share a worker share its time."""

from __future__ import annotations

from collections import Counter

from hypothesis import given, settings
from hypothesis import strategies as st
from lineloom_service.engine.messages import Chapter, Feed, StartSite, StopSite
from lineloom_service.engine.turns import Turns


def _feed(site: int, through: int = 0) -> Feed:
    return Feed(site, 1, (), through, caught_up=False)


def _work(turns: Turns, seconds: dict[int, float], steps: int) -> Counter[int]:
    """Let every turn take its site's seconds; return how many each site had."""
    had: Counter[int] = Counter()
    for _ in range(steps):
        site = turns.next().site
        turns.spend(site, seconds[site])
        had[site] += 1
    return had


@settings(max_examples=50, deadline=None)
@given(seconds=st.lists(st.floats(0.001, 0.1), min_size=2, max_size=6))
def test_sites_with_endless_work_use_the_same_time(seconds: list[float]) -> None:
    turns = Turns()
    cost = dict(enumerate(seconds))
    for site in cost:
        turns.put(_feed(site))
    had = _work(turns, cost, 2000)
    used = [had[site] * cost[site] for site in cost]
    assert max(used) - min(used) <= max(seconds) + 1e-9


def test_a_small_site_does_not_wait_for_a_huge_one() -> None:
    turns = Turns()
    turns.put(_feed(1))
    _work(turns, {1: 1.0}, 1000)
    turns.put(_feed(2))
    assert turns.next().site in (1, 2)
    had = _work(turns, {1: 1.0, 2: 0.01}, 300)
    assert had[2] >= 100 * had[1] - 100


def test_idle_time_is_not_saved_up() -> None:
    turns = Turns()
    for site in (1, 2):
        turns.put(_feed(site))
    turns.done(2)
    _work(turns, {1: 1.0}, 1000)
    turns.put(_feed(2))
    had = _work(turns, {1: 1.0, 2: 1.0}, 100)
    assert abs(had[1] - had[2]) <= 1


def test_within_a_site_orders_stay_in_order() -> None:
    turns = Turns()
    for through in range(5):
        turns.put(_feed(1, through))
    seen = []
    while turns:
        order = turns.next()
        assert isinstance(order, Feed)
        seen.append(order.through)
        turns.done(1)
    assert seen == [0, 1, 2, 3, 4]


def test_a_new_start_voids_what_waits() -> None:
    turns = Turns()
    turns.put(_feed(1))
    turns.put(Chapter(1, 2, b"history"))
    assert isinstance(turns.next(), Chapter)
    turns.put(StartSite(1, 2, 0, None, {}))
    assert isinstance(turns.next(), StartSite)
    turns.put(StopSite(1))
    assert isinstance(turns.next(), StopSite)
    turns.done(1)
    assert not turns
