"""What the robots' scans gave, whatever is believed of it: the keyframes in their order.

Tracking never asks what is known of other robots, so a keyframe is a fact. All beliefs, that is
constraints, merges and poses, are a function of the history and of the verdicts upon it, and can
be had again by `rebuild`.

Only the latest keyframes are held here. Those before are sealed in chapters, which go to the disk:
a fleet that drives all day adds a hundred thousand keyframes and no building.
"""

from __future__ import annotations

import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from lineloom_core.codec import storable
from lineloom_core.mapping.facts.chapter import Chapter
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.facts.keyframe_table import KeyframeTable
from lineloom_core.mapping.facts.spool import Spool
from lineloom_core.places import Recognition

HandOver = Callable[[int, int], dict[tuple[int, int], Recognition]]
"""Recognitions of the places with ids from `begin` up to `end`."""

_UNPACKED = 2
"""Chapters at hand as objects, for those who read one keyframe after another."""


@storable("history", _length=int, _open=bytes, _table=KeyframeTable, _tracks=int, _checks=list[int])
class History:
    """Keyframes and tracks are numbered in the order they were made; numbers are never reused.

    chapter: keyframes in each.
    """

    def __init__(self, chapter: int) -> None:
        self._length = chapter
        self._chapters = Spool()
        self._open: dict[int, Keyframe] = {}
        self._table = KeyframeTable()
        self._tracks = 0
        self._checks: list[int] = []  # of the chapters, in their order
        self._begin()

    def _begin(self) -> None:
        self._unpacked: OrderedDict[int, Chapter] = OrderedDict()
        # What the map holds anyway is not made again: its features are known by the object.
        self._held: WeakValueDictionary[int, Keyframe] = WeakValueDictionary(self._open)

    def __getstate__(self) -> dict[str, Any]:
        """Without chapters: those are saved once (`chapters`) and handed back (`bind`)."""
        kept = ("_length", "_table", "_tracks", "_checks")
        state = {name: self.__dict__[name] for name in kept}
        return {**state, "_open": Chapter(tuple(self._open.values()), {}).pack()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._open = {f.id: f for f in Chapter.unpack(state["_open"]).keyframes}
        self._chapters = Spool()
        self._begin()

    @property
    def sealed(self) -> int:
        """Number of chapters."""
        return len(self._chapters)

    def chapters(self, known: int) -> tuple[bytes, ...]:
        """The packed chapters after the first `known`."""
        return tuple(self._chapters[number] for number in range(known, self.sealed))

    def bind(self, chapters: Sequence[bytes]) -> None:
        """Take the chapters that were left out of the state. Raises ValueError for other ones.

        Looked at now: otherwise a damaged one were found when somebody undoes something.
        """
        if len(chapters) != len(self._checks):
            raise ValueError(f"{len(chapters)} chapters, expected {len(self._checks)}")
        for number, (chapter, check) in enumerate(zip(chapters, self._checks, strict=True)):
            if zlib.crc32(chapter) != check:
                raise ValueError(f"chapter {number} is damaged")
        for chapter in chapters:
            self._chapters.append(chapter)

    def new_track(self) -> int:
        """The next track's number."""
        self._tracks += 1
        return self._tracks - 1

    def new_keyframe(self) -> int:
        """The next keyframe's id; `add` that keyframe before asking for another."""
        return len(self._table)

    def add(self, keyframe: Keyframe) -> None:
        """Append a keyframe."""
        self._open[keyframe.id] = self._held[keyframe.id] = keyframe
        self._table.add(keyframe)

    def seal(self, hand_over: HandOver) -> None:
        """Close a chapter when there is enough for one; `hand_over` gives what belongs to it."""
        begin = self.sealed * self._length
        end = begin + self._length
        if len(self._table) < end:
            return
        over = tuple(f for k, f in self._open.items() if k < end)
        packed = Chapter(over, hand_over(begin, end)).pack()
        self._chapters.append(packed)
        self._checks.append(zlib.crc32(packed))
        self._open = {k: f for k, f in self._open.items() if k >= end}

    def __getitem__(self, keyframe: int) -> Keyframe:
        """The keyframe of this id. Raises KeyError where there is none."""
        found = self._held.get(keyframe)
        if found is not None:
            return found
        if keyframe >= self.sealed * self._length or not self._table.is_here(keyframe):
            raise KeyError(keyframe)
        chapter = self._chapter(keyframe // self._length)
        return self._as_is(next(f for f in chapter.keyframes if f.id == keyframe))

    def since(self, begin: int) -> Iterator[Keyframe]:
        """The keyframes from this id on, in their order."""
        for number in range(begin // self._length, self.sealed):
            for f in self._chapter(number).keyframes:
                if f.id >= begin and self._table.is_here(f.id):
                    yield self._as_is(f)
        yield from [f for k, f in self._open.items() if k >= begin]

    def recognitions(self, place: int) -> dict[tuple[int, int], Recognition]:
        """What came of comparing places before the chapter of this one was sealed; else nothing."""
        number = place // self._length
        return self._chapter(number).recognitions if number < self.sealed else {}

    def of(self, robot: str, session: str | None = None) -> list[int]:
        """Ids of a robot's keyframes, ascending; of one session or of all."""
        ids: list[int] = self._table.of(robot, session).tolist()
        return ids

    def distrust(self, robot: str, session: str) -> None:
        """Mark all keyframes of a robot's session: its lidar's geometry is wrong."""
        ids = self._table.of(robot, session)
        self._table.distrust(ids)
        for k in ids.tolist():
            self._held.pop(k, None)
            if k in self._open:
                self._open[k] = self._held[k] = replace(self._open[k], trusted=False)

    def forget(self, robot: str) -> None:
        """Drop a robot's keyframes."""
        ids = self._table.of(robot)
        self._table.forget(ids)
        for k in ids.tolist():
            self._held.pop(k, None)
            self._open.pop(k, None)

    def nearest(self, robot: str, session: str, seq: int) -> Keyframe | None:
        """The keyframe of a session with the nearest sequence number; None without any."""
        found = self._table.nearest(robot, session, seq)
        return None if found is None else self[found]

    def around(self, keyframe: Keyframe, reach: int) -> list[Keyframe]:
        """The keyframe and up to `reach` before and after it on its track, nearest first."""
        chain = self._table.on_track(keyframe.id)
        where = int(np.searchsorted(chain, keyframe.id))
        nearest = sorted(range(len(chain)), key=lambda i: (abs(i - where), i))
        return [self[int(chain[i])] for i in nearest if abs(i - where) <= reach]

    def before(self, keyframe: Keyframe) -> Iterator[Keyframe]:
        """The keyframes before this one on its track, the latest first."""
        chain = self._table.on_track(keyframe.id)
        for k in reversed(chain[chain < keyframe.id].tolist()):
            yield self[k]

    def _as_is(self, fact: Keyframe) -> Keyframe:
        """A keyframe out of a chapter as it is believed today: the one object, as long as any."""
        held = self._held.get(fact.id)
        if held is not None:
            return held
        if fact.trusted != self._table.is_trusted(fact.id):
            fact = replace(fact, trusted=self._table.is_trusted(fact.id))
        self._held[fact.id] = fact
        return fact

    def _chapter(self, number: int) -> Chapter:
        chapter = self._unpacked.pop(number, None)
        if chapter is None:
            chapter = Chapter.unpack(self._chapters[number])
        self._unpacked[number] = chapter
        if len(self._unpacked) > _UNPACKED:
            self._unpacked.popitem(last=False)
        return chapter
