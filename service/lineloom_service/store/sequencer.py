"""In which order a robot's scans are fed to the mapper, when they arrive in any order.

A scan is released when it is the next of its session (the first expected is 0), else held until
the gap before it fills or it has waited for the gap window. Sessions go in the order first seen:
a younger one waits while an older one still holds scans, and never longer than the window. A scan
that arrives after its successors were released goes out at once: late is better than never.

Pure and without a clock of its own: `now` is given, ids are the caller's.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass(slots=True)
class Stream:
    """One session of one robot.

    released: the greatest seq released so far, None before the first. highest: the greatest seq
    ever accepted. held: seq -> (entry id, time of arrival), in order of arrival.
    """

    id: int
    session: str
    released: int | None = None
    highest: int = -1
    accepted: int = 0
    held: dict[int, tuple[int, float]] = field(default_factory=dict)

    @property
    def expected(self) -> int:
        """The seq that may go out without waiting."""
        return 0 if self.released is None else self.released + 1

    def hold(self, seq: int, entry: int, now: float) -> None:
        """Take in a new scan."""
        self.held[seq] = (entry, now)
        self.highest = max(self.highest, seq)
        self.accepted += 1

    def pop_ready(self) -> list[int]:
        """Release the late ones, then everything from the expected seq on without a gap."""
        released = self.pop_up_to(self.expected - 1)
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
        """How many scans wait."""
        return sum(len(stream.held) for stream in self.streams.values())

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
        """Release everything, gaps or not."""
        released: list[int] = []
        for stream in self.streams.values():
            released += stream.pop_up_to(stream.highest)
        return released

    def next_deadline(self) -> float | None:
        """When the longest waiting scan must go out; None when none waits."""
        oldest = [
            next(iter(stream.held.values()))[1] for stream in self.streams.values() if stream.held
        ]
        return min(oldest) + self._window_s if oldest else None
