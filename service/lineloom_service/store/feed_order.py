"""In which order the mapper is fed where scans came late.

The log only grows: what arrived late has its position at the end, in a batch that an entry of kind
`order` closes. That entry says behind which position each of the batch belongs; from there on the
log is read so rewritten, all that was before in the order that it had. An order is a function of
the log alone, and one of later date has the places of those before it as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import msgpack
import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, select

from lineloom_service.store import tables

ORDER_ROBOT = "~"
"""The name of the robot that a site's `order` entries belong to; no robot can be called so."""

_FORMAT = 1

Place = tuple[int, int, int, int]
"""A late scan: the position that it comes behind, its session's id, its seq, its own position.

Behind a position, late scans go by session and seq."""


@dataclass(frozen=True)
class FeedOrder:
    """The order that the entry at `position` made; position 0: that of the log.

    places: of all late scans up to there, in order.
    """

    position: int = 0
    places: Sequence[Place] = field(default=())

    def feed(self, after: int, limit: int) -> NDArray[np.int64]:
        """Return the positions in the log of what is fed as numbers after + 1, after + 2, …"""
        return self._positions[after : after + limit]

    def number(self, position: int) -> int:
        """Return as which number the entry at a position in the log is fed."""
        return int(self._numbers[position]) if position <= self.position else position

    def anchor(self, position: int) -> int:
        """Return behind which entry that was in time this one comes; its own position for those."""
        return self._anchors.get(position, position)

    def alike(self, other: FeedOrder) -> int:
        """Return how many of the entries that are fed are the same by both, from the first on."""
        if self.position > other.position:
            return other.alike(self)
        # What the other order placed, this one does not feed: not even at the end.
        end = min((p[3] for p in other.places if p[3] > self.position), default=other.position + 1)
        mine = np.arange(1, other.position + 1)
        mine[: self.position] = self._positions
        differ = np.flatnonzero(mine != other._positions)
        return min(int(differ[0]) if len(differ) else other.position, end - 1)

    @cached_property
    def _anchors(self) -> dict[int, int]:
        return {position: anchor for anchor, _, _, position in self.places}

    @cached_property
    def _positions(self) -> NDArray[np.int64]:
        late = np.array([place[3] for place in self.places], np.int64)
        behind = np.array([place[0] for place in self.places], np.int64)
        rest = np.setdiff1d(np.arange(1, self.position + 1), late, assume_unique=True)
        anchors = np.concatenate((rest, behind))
        # What is on time comes first at its own position, then the late ones in their order.
        ranks = np.concatenate((np.zeros(len(rest), np.int64), np.arange(1, len(late) + 1)))
        return np.concatenate((rest, late))[np.lexsort((ranks, anchors))]

    @cached_property
    def _numbers(self) -> NDArray[np.int64]:
        numbers = np.zeros(self.position + 1, np.int64)
        numbers[self._positions] = np.arange(1, self.position + 1)
        return numbers


def making_id(made: str, order: int) -> str:
    """Return what a map is keyed by that is made so, of the log in that order."""
    return f"{made}+{order}" if order else made


def parted(making: str) -> tuple[str, int]:
    """Return the two parts of what `making_id` returned."""
    made, _, order = making.partition("+")
    return made, int(order) if order.isdigit() else 0


def encode_order(former: int, places: Sequence[Place]) -> bytes:
    """Return the body of an `order` entry. former: position of the one before it, 0: none."""
    packed: bytes = msgpack.packb((_FORMAT, former, places))
    return packed


def read_order(connection: Connection, site_id: int, position: int) -> FeedOrder:
    """Return the order that the entry at `position` made; 0: that of the log."""
    c = tables.entries.c
    places: list[Place] = []
    at = position
    while at:
        query = select(c.body).where(c.site_id == site_id, c.position == at)
        _, at, batch = msgpack.unpackb(connection.execute(query).scalar_one())
        places += [(anchor, stream, seq, own) for anchor, stream, seq, own in batch]
    return FeedOrder(position, tuple(sorted(places)))
