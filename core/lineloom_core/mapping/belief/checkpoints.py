"""What was believed earlier: going through the history again need not begin at its beginning.

A verdict on a constraint changes nothing that was believed before both of its keyframes were there,
so beliefs of that time can be taken up again under other verdicts, bit by bit the same as made
anew. Kept are beliefs as bytes on the disk, the older the sparser: their number grows with the
logarithm of the history. A cache: without any of them all comes out the same, later.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from lineloom_core.mapping.belief.by_reference import dumps, loads
from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.verdicts import Verdicts
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.facts.spool import Spool, Spooled

_THINNER = 4
"""Of those this many times as old, this share is kept."""


@dataclass(frozen=True, slots=True)
class _Checkpoint:
    number: int
    next_keyframe: int
    data: Spooled


class Checkpoints:
    """Beliefs as they were at some keyframes of a history, under the verdicts of today."""

    def __init__(self, config: MapperConfig, history: History, memory: Memory) -> None:
        self.history = history
        self._config = config
        self._memory = memory
        self._kept: list[_Checkpoint] = []
        self._spool = Spool()
        self._made = 0

    def __len__(self) -> int:
        return len(self._kept)

    def copy(self) -> Checkpoints:
        """The same, to try something with."""
        other = Checkpoints(self._config, self.history, self._memory)
        other._kept, other._made, other._spool = list(self._kept), self._made, self._spool
        return other

    def note(self, site: SiteMap, keyframe: int) -> None:
        """Keep what is believed after this keyframe, if it is time to.

        Not while the map has grown by less than a quarter, for a checkpoint costs in proportion.
        """
        last = self._kept[-1].next_keyframe if self._kept else 0
        if keyframe + 1 - last < max(self._config.checkpoint_every, len(site.keyframes) // 4):
            return
        data = Spooled(self._spool, self._as_bytes(site))
        self._kept.append(_Checkpoint(self._made, keyframe + 1, data))
        self._made += 1
        self._kept = [c for c in self._kept if _stays(c.number, self._made - c.number)]

    def resume(self, affected: int, verdicts: Verdicts) -> tuple[SiteMap, Iterator[Keyframe]]:
        """The beliefs before the keyframe `affected`, and the keyframes that follow.

        As far as there are any kept; those that came after are wrong now, and dropped.
        """
        self._kept = [c for c in self._kept if c.next_keyframe <= affected]
        if not self._kept:
            site = SiteMap(self._config, self._memory, verdicts)
            return site, self.history.since(0)
        begin = self._kept[-1].next_keyframe
        site = self._from_bytes(self._kept[-1].data.read())
        site.verdicts = verdicts
        return site, self.history.since(begin)

    def _as_bytes(self, site: SiteMap) -> bytes:
        return zlib.compress(dumps(site), 1)

    def _from_bytes(self, data: bytes) -> SiteMap:
        whole = zlib.decompress(data)  # ours, from the spool
        site: SiteMap = loads(whole, SiteMap, self.history, self._memory, self._config)
        return site


def _stays(number: int, age: int) -> bool:
    """Whether a checkpoint is still worth keeping when `age` more have been made."""
    share = 1
    while age >= share * _THINNER:
        share *= _THINNER
    return number % share == 0
