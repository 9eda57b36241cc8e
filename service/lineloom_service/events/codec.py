"""Events as the store keeps them, and as listeners get them."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from lineloom import wire

_ID = re.compile(r"(\d{1,18})-(\d{1,18})(?:-(\d{1,9}))?")


@dataclass(frozen=True, slots=True)
class Told:
    """One event, ready to be sent. data: JSON."""

    type: str
    data: str


@dataclass(frozen=True, slots=True)
class Place:
    """Where a listener is in a site's history: it has the batches before `number` whole.

    seen: how many events of batch `number` it has; None: all of them. Written `site-number-seen`,
    with the site's never reused id: the `id` of a Server-Sent Event.
    """

    site_id: int
    number: int
    seen: int | None = None

    def __str__(self) -> str:
        return "-".join(str(p) for p in (self.site_id, self.number, self.seen) if p is not None)

    @classmethod
    def parse(cls, text: str) -> Place | None:
        """Read what a listener sent, None where it is no place."""
        found = _ID.fullmatch(text.strip())
        if found is None:
            return None
        site_id, number, seen = found.groups()
        return cls(int(site_id), int(number), None if seen is None else int(seen))


def encode(events: Sequence[wire.AnyEvent]) -> tuple[Told, ...]:
    """Return events as they are sent."""
    return tuple(Told(event.type, event.model_dump_json()) for event in events)


def pack(told: Sequence[Told]) -> bytes:
    """Return a batch's body for the store: a line an event, its type before its JSON."""
    lines = "\n".join(f"{event.type} {event.data}" for event in told)
    return zlib.compress(lines.encode(), 1)


def tells_settled(body: bytes) -> bool:
    """Return whether a batch is of a settled view: its map event says so."""
    return any(t.type == "map" and json.loads(t.data).get("settled") for t in unpack(body))


def unpack(body: bytes) -> tuple[Told, ...]:
    """Return the events of a batch's body."""
    lines = zlib.decompress(body).decode().split("\n")
    return tuple(Told(*line.split(" ", 1)) for line in lines if line)
