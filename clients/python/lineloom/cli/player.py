"""Plays scheduled scans to the service, as the robots would send them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from lineloom.cli.schedule import Due
from lineloom.client import Client
from lineloom.wire import Scan


@dataclass
class Played:
    """What became of the scans."""

    sent: int = 0
    accepted: int = 0
    duplicates: int = 0
    rejected: list[str] = field(default_factory=list)


class Player:
    """Sends scans in order, in batches; one robot's POST follows another's.

    speed: multiple of real time; None = as fast as the service takes them. on_sent is called
    after every POST.
    """

    def __init__(
        self,
        client: Client,
        site: str,
        *,
        batch: int,
        speed: float | None = None,
        on_sent: Callable[[Played], object] | None = None,
    ) -> None:
        self._client = client
        self._site = site
        self._batch = batch
        self._speed = speed
        self._on_sent = on_sent
        self._waiting: dict[str, list[Scan]] = {}
        self.played = Played()

    def play(self, scans: Iterable[Due]) -> Played:
        """Send them all, and return what became of them."""
        begin = time.monotonic()
        for due in scans:
            if self._speed is not None:
                ahead = due.at / self._speed - (time.monotonic() - begin)
                if ahead > 0.0:
                    # What is due goes out before the pause, not after it.
                    self.flush()
                    time.sleep(ahead)
            self.add(due.robot, due.scan)
        self.flush()
        return self.played

    def add(self, robot: str, scan: Scan) -> None:
        """Take one scan; it goes out when its batch is full."""
        waiting = self._waiting.setdefault(robot, [])
        waiting.append(scan)
        if len(waiting) >= self._batch:
            self._post(robot)

    def flush(self) -> None:
        """Send what is waiting."""
        for robot in list(self._waiting):
            self._post(robot)

    def _post(self, robot: str) -> None:
        scans = self._waiting.pop(robot)
        answer = self._client.post_scans(self._site, robot, scans, batch=self._batch)
        played = self.played
        played.sent += len(scans)
        played.accepted += answer.accepted
        played.duplicates += answer.duplicates
        played.rejected += [
            f"{robot} seq {refusal.seq}: {refusal.reason}"
            + (f": {refusal.detail}" if refusal.detail else "")
            for refusal in answer.rejected
        ]
        if self._on_sent is not None:
            self._on_sent(played)
