"""A mapper's state as bytes, to go on from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.codec import storable


class SnapshotError(ValueError):
    """A snapshot that this version cannot read: rebuild from the log instead."""


@storable("snapshot")
@dataclass(frozen=True, slots=True)
class Snapshot:
    """State, and chapters of the history that it goes on from.

    Chapters are numbered from 0 and never change once they are there: who has kept the first
    `first` of them from earlier snapshots of the same mapper need not take them again. To resume
    it takes them all, so `first` must be 0.
    """

    state: bytes
    first: int = 0
    chapters: tuple[bytes, ...] = ()

    @property
    def end(self) -> int:
        """Number of chapters that the state goes on from."""
        return self.first + len(self.chapters)
