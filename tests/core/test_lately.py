"""Objects remember what was made of them: the latest, and only as long as they are there."""

from __future__ import annotations

import gc
from dataclasses import dataclass
from weakref import ref

import numpy as np
from lineloom_core.lately import KeptWithin, UsedLately


@dataclass(frozen=True, eq=False)
class Thing:
    number: int


class Made:
    pass


def test_what_is_remembered_is_that_of_the_slow_twin() -> None:
    made: list[int] = []

    def squared(thing: Thing) -> int:
        made.append(thing.number)
        return thing.number**2

    square = UsedLately[Thing, int](squared, 5)
    things = [Thing(k) for k in range(12)]
    twin: list[int] = []
    for k in np.random.default_rng(1).integers(0, 12, size=400).tolist():
        known = k in twin
        twin = [*(n for n in twin if n != k), k][-5:]
        before = len(made)
        assert square(things[k]) == k * k
        assert (len(made) == before) == known
        assert len(square) == len(twin)


def test_it_keeps_nothing_alive() -> None:
    lately = UsedLately[Thing, Made](lambda _: Made(), 100)
    things = [Thing(k) for k in range(10)]
    made = [ref(lately(thing)) for thing in things]
    del things[3:]
    gc.collect()
    assert [m() is not None for m in made] == [True] * 3 + [False] * 7
    assert len(lately) == 3


def test_who_forgets_lets_go_of_what_was_made() -> None:
    lately = UsedLately[Thing, Made](lambda _: Made(), 2)
    things = [Thing(k) for k in range(4)]
    made = [ref(lately(thing)) for thing in things]
    gc.collect()
    assert [m() is not None for m in made] == [False, False, True, True]


def test_two_of_them_do_not_meddle() -> None:
    double = UsedLately[Thing, int](lambda thing: 2 * thing.number, 3)
    triple = UsedLately[Thing, int](lambda thing: 3 * thing.number, 1)
    things = [Thing(k) for k in range(4)]
    for _ in range(2):
        assert [(double(t), triple(t)) for t in things] == [(0, 0), (2, 3), (4, 6), (6, 9)]


def test_what_there_is_room_for_is_kept_and_the_rest_made_anew() -> None:
    made: list[int] = []

    def squared(thing: Thing) -> int:
        made.append(thing.number)
        return thing.number**2

    square = KeptWithin[Thing, int](squared, lambda _: 10, 35)
    things = [Thing(k) for k in range(5)]
    for _ in range(2):
        assert [square(thing) for thing in things] == [0, 1, 4, 9, 16]
    assert made == [0, 1, 2, 3, 4, 3, 4]
    assert len(square) == 3


def test_what_goes_makes_room() -> None:
    kept = KeptWithin[Thing, Made](lambda _: Made(), lambda _: 10, 20)
    things = [Thing(k) for k in range(3)]
    made = [ref(kept(thing)) for thing in things]
    del things[0]
    gc.collect()
    assert [m() is not None for m in made] == [False, True, False]
    assert kept(things[1]) is kept(things[1])
