"""In which order a robot's scans are fed to the mapper, when they arrive in any order.

A scan is released when it is the next of its session (the first expected is 0), else held until
the gap before it fills or it has waited for the gap window. Sessions go in the order first seen:
a younger one waits while an older one still holds scans, and never longer than the window. A scan
that arrives after its successors were released is late: it is kept apart until `place_late` gives
all of them the places that they should have had.

Pure and without a clock of its own: `now` is given, ids are the caller's.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass(slots=True)
class Stream:
    """One session of one robot.

    released: the greatest seq released so far, None before the first. highest: the greatest seq
    ever accepted. held: seq -> (entry id, time of arrival), in order of arrival. late: seq -> entry
    id. contents: of the scans that were numbered here lately, digest -> seq; None: not read yet.
    """

    id: int
    session: str
    released: int | None = None
    highest: int = -1
    accepted: int = 0
    held: dict[int, tuple[int, float]] = field(default_factory=dict)
    late: dict[int, int] = field(default_factory=dict)
    contents: dict[bytes, int] | None = None

    @property
    def expected(self) -> int:
        """The seq that may go out without waiting."""
        return 0 if self.released is None else self.released + 1

    def hold(self, seq: int, entry: int, now: float, *, late: bool) -> None:
        """Take in a new scan."""
        self.keep(seq, entry, now, late=late)
        self.highest = max(self.highest, seq)
        self.accepted += 1

    def keep(self, seq: int, entry: int, now: float, *, late: bool) -> None:
        """Have a scan wait."""
        if late:
            self.late[seq] = entry
        else:
            self.held[seq] = (entry, now)

    def pop_ready(self) -> list[int]:
        """Release everything from the expected seq on without a gap."""
        released: list[int] = []
        while (seq := self.expected) in self.held:
            released.append(self.held.pop(seq)[0])
            self.released = seq
        return released

    def pop_up_to(self, seq: int) -> list[int]:
        """Release all held scans up to `seq`, gaps or not."""
        if not self.held:
            return []
        due = sorted(s for s in self.held if s <= seq)
        if due:
            self.released = due[-1] if self.released is None else max(self.released, due[-1])
        return [self.held.pop(s)[0] for s in due]

    def overdue(self, now: float, window_s: float, max_held: int) -> int | None:
        """Return the greatest seq that must not wait any longer, or None."""
        greatest: int | None = None
        for seq, (_, arrived) in self.held.items():
            if arrived + window_s > now:
                break
            greatest = seq if greatest is None else max(greatest, seq)
        if len(self.held) > max_held:
            crowded_out = sorted(self.held)[len(self.held) - max_held - 1]
            greatest = crowded_out if greatest is None else max(greatest, crowded_out)
        return greatest


class Sequencer:
    """The sessions of one robot, in the order first seen."""

    def __init__(self, window_s: float, max_held: int, streams: Iterable[Stream] = ()) -> None:
        self._window_s = window_s
        self._max_held = max_held
        self.streams: dict[str, Stream] = {stream.session: stream for stream in streams}

    @property
    def held(self) -> int:
        """How many scans wait for those before them."""
        return sum(len(stream.held) for stream in self.streams.values())

    @property
    def late(self) -> int:
        """How many scans came after their successors were released."""
        return sum(len(stream.late) for stream in self.streams.values())

    def is_late(self, stream: Stream, seq: int) -> bool:
        """Whether scans that come after this one have gone out: of its session or a younger one."""
        if stream.released is not None and seq <= stream.released:
            return True
        younger = itertools.dropwhile(lambda s: s is not stream, self.streams.values())
        return any(s.released is not None for s in younger if s is not stream)

    @property
    def accepted(self) -> int:
        """How many scans were ever taken in."""
        return sum(stream.accepted for stream in self.streams.values())

    def release(self, now: float) -> list[int]:
        """Return the entries that may go to the mapper now, in their order."""
        released: list[int] = []
        waiting = [stream for stream in self.streams.values() if stream.held]
        for index, stream in enumerate(waiting):
            overdue = stream.overdue(now, self._window_s, self._max_held)
            if overdue is not None:
                for older in waiting[:index]:
                    released += older.pop_up_to(older.highest)
                released += stream.pop_up_to(overdue)
            if not any(older.held for older in waiting[:index]):
                released += stream.pop_ready()
        return released

    def flush(self) -> list[int]:
        """Release everything that is not late, gaps or not."""
        released: list[int] = []
        for stream in self.streams.values():
            released += stream.pop_up_to(stream.highest)
        return released

    def pop_late(self) -> list[tuple[Stream, list[tuple[int, int]]]]:
        """Give the late ones away: by session, seq and entry id in the order of seq."""
        found = [(s, sorted(s.late.items())) for s in self.streams.values() if s.late]
        for stream, _ in found:
            stream.late = {}
        return found

    def next_deadline(self) -> float | None:
        """When the longest waiting scan must go out; None when none waits."""
        oldest = [
            next(iter(stream.held.values()))[1] for stream in self.streams.values() if stream.held
        ]
        return min(oldest) + self._window_s if oldest else None
