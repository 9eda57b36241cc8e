"""What the store takes and gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from lineloom_core.codec import storable

from lineloom_service.store.config_entry import ConfigEntry

EntryKind = Literal[
    "scan", "late", "mount", "forget", "retract", "restore", "join", "config", "order"
]
"""late: a scan that came after its successors; the next `order` says where it belongs
(`store.feed_order`)."""
SCANS: frozenset[EntryKind] = frozenset({"scan", "late"})

ActionKind = Literal["retract", "restore", "join"]
"""What an operator can do to a constraint; the entry's body is what it claims (`store.codec`).

join: say that it is so.
"""


@dataclass(frozen=True, slots=True)
class NewScan:
    """A scan to be stored. body: as `store.codec` encodes it.

    seq: None where the service is to number it, by `stamp` and arrival. index: its place in the
    request.
    """

    session: str
    seq: int | None
    body: bytes
    stamp: float = 0.0
    index: int = 0


@storable("log-entry")
@dataclass(frozen=True, slots=True)
class LogEntry:
    """One entry of a site's log, at its place in the order in which the mapper is fed."""

    position: int
    kind: EntryKind
    robot: str
    session: str | None
    seq: int | None
    body: bytes | None


@dataclass(frozen=True, slots=True)
class RobotRecord:
    """accepted: its durable scans. held: those of them that wait for a gap in seq to fill.

    late: those that came after their successors, and are about to be given their place.
    """

    name: str
    accepted: int
    held: int
    mount: bytes | None
    late: int = 0


@dataclass(frozen=True, slots=True)
class SiteRecord:
    """A site as of the last commit.

    id: never used again, also when a deleted site's name is. position: entries released to the
    mapper so far, 1..position without holes. held: scans accepted, but not yet released; late:
    those of them that came after their successors. config: what its map is made with, None for the
    defaults. order: position of the entry that last gave late scans their places, 0: none did.
    deleted: it is gone, and nothing else here means anything.
    """

    id: int
    name: str
    position: int
    held: int
    accepted: int
    robots: dict[str, RobotRecord] = field(default_factory=dict)
    config: ConfigEntry | None = None
    deleted: bool = False
    late: int = 0
    order: int = 0


@dataclass(frozen=True, slots=True)
class Conflict:
    """A scan that was not taken: its session has another one of this seq. index: in the request.

    stamp, known: its own and the other's time [s].
    """

    index: int
    session: str
    seq: int
    stamp: float
    known: float


@dataclass(frozen=True, slots=True)
class Appended:
    """What became of the scans of one POST; position and held are the site's right after it."""

    accepted: int
    duplicates: int
    site_id: int
    position: int
    held: int
    conflicts: tuple[Conflict, ...] = ()


@dataclass(frozen=True, slots=True)
class SnapshotRecord:
    """A mapper's state after the entry at `position`.

    scans: scan entries among 1..position that the mapper took. producer: the code that wrote it;
    other code replays the log instead. chapters: of the history that the state goes on from, those
    from number `first` on; the ones before are kept already. One that was read comes without any.
    """

    position: int
    scans: int
    producer: str
    data: bytes
    first: int = 0
    chapters: tuple[bytes, ...] = ()

    @property
    def end(self) -> int:
        """Number of chapters that the state goes on from."""
        return self.first + len(self.chapters)


@dataclass(frozen=True, slots=True)
class ViewRecord:
    """A view published after the entry at `position`, for the other processes' queries."""

    position: int
    data: bytes


@storable("skip")
@dataclass(frozen=True, slots=True)
class Skip:
    """An entry that is never fed to the mapper again, and why."""

    position: int
    robot: str
    kind: EntryKind
    session: str | None
    seq: int | None
    reason: str


@dataclass(frozen=True, slots=True)
class EventBatch:
    """The events of one published view.

    number: 1, 2, … without holes. position, version: of the view. producer: the code that
    published it. body: as `events.codec` encodes it.
    """

    number: int
    position: int
    version: int
    producer: str
    body: bytes


class BacklogFullError(Exception):
    """The site's mapper is too far behind; nothing of the POST was taken.

    robot: whose share of the backlog is full, None where it is the site's whole.
    """

    def __init__(self, pending: int, limit: int, robot: str | None = None) -> None:
        whose = "" if robot is None else f" of robot {robot!r}"
        super().__init__(f"{pending} entries{whose} wait to be mapped, the limit is {limit}")
        self.pending = pending
        self.limit = limit
        self.robot = robot


class ChapterLostError(Exception):
    """A chapter that a snapshot goes on from is not there, or is not what was saved."""


class StoreError(Exception):
    """The storage failed: nothing of the request was taken. The text is safe to show."""


class StorageFullError(StoreError):
    """There is no room for it."""


class DamagedError(StoreError):
    """What is stored is not what was written, or cannot be read any more. Others can."""
