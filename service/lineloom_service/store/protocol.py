"""What the service needs of a storage, and nothing more."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Sequence
from typing import Literal, Protocol

from lineloom_service.security.token import TokenRecord
from lineloom_service.store.database import Claim
from lineloom_service.store.files import FileKind, FileRecord
from lineloom_service.store.records import (
    ActionKind,
    Appended,
    EventBatch,
    LogEntry,
    NewScan,
    SiteRecord,
    Skip,
    SnapshotRecord,
    ViewRecord,
)

CommitListener = Callable[[SiteRecord], None]
"""Called on the event loop with every site at `open`, and after each commit, of whatever process,
with those that it changed, before the request is answered."""

NewsKind = Literal["view", "events", "question", "answer"]
NEWS: dict[str, NewsKind] = {
    "view": "view",
    "events": "events",
    "question": "question",
    "answer": "answer",
}

NewsListener = Callable[[NewsKind, str], None]
"""Called on the event loop with what any process saved, and the id of its site or question."""


class Store(Protocol):
    """An append-only log per site, with the order in which the mapper is fed.

    Whatever an `await` returned from is on disk. Names of sites and robots are unique among
    those that exist; a name that was deleted may be used again for something new.

    shared: other processes may use the same storage at the same time. One of all maps: it has a
    claim, and what else only it may write raises StoreError once the claim is lost.
    """

    @property
    def shared(self) -> bool:
        """Whether there may be other processes."""
        ...

    async def open(self) -> None:
        """Make the storage usable, upgrading an older one."""
        ...

    async def close(self) -> None:
        """Let go of it. What was awaited is safe."""
        ...

    def subscribe(self, listener: CommitListener) -> None:
        """Have `listener` told of every site that a commit changed."""
        ...

    async def append_scans(
        self,
        site: str,
        robot: str,
        scans: Sequence[NewScan],
        *,
        processed: int,
        limit: int,
        robot_limit: int | None = None,
    ) -> Appended:
        """Store scans of one robot, creating site and robot on first use.

        Raises BacklogFullError, taking nothing, where more than `limit` entries wait already, or
        more than `robot_limit` of this robot's (as many as `limit` if None);
        `processed`: how many of the site's released entries the mapper is known to be through.
        """
        ...

    async def set_mount(self, site: str, robot: str, mount: bytes | None) -> None:
        """Log the robot's mount (None: none) for the scans that follow, creating the robot.

        The same again changes nothing.
        """
        ...

    async def forget_robot(self, site: str, robot: str) -> bool:
        """Log that a robot is to be forgotten. False where there is none of that name."""
        ...

    async def act(self, site: str, robot: str, kind: ActionKind, constraint: str) -> int | None:
        """Log what an operator does to a constraint of this robot; return the entry's position.

        None where there is no such robot.
        """
        ...

    async def delete_site(self, site: str) -> int | None:
        """Forget a site and all its scans; return its id, None where there is none."""
        ...

    async def sites(self) -> list[SiteRecord]:
        """All sites by name."""
        ...

    async def site(self, site: str) -> SiteRecord | None:
        """One site."""
        ...

    async def read_feed(self, site_id: int, after: int, limit: int) -> list[LogEntry]:
        """Return the released entries after position `after`, at most `limit`, in order."""
        ...

    async def record_skip(self, site_id: int, position: int, reason: str) -> Skip:
        """Note durably that this entry is never to be fed again."""
        ...

    async def skips(self, site_id: int) -> list[Skip]:
        """All skipped entries of a site by position."""
        ...

    async def save_snapshot(self, site_id: int, snapshot: SnapshotRecord) -> None:
        """Keep a snapshot with its new chapters; older ones but the last go.

        So do the chapters that none of those kept goes on from.
        """
        ...

    async def latest_snapshot(self, site_id: int, producer: str) -> SnapshotRecord | None:
        """Return the newest snapshot that `producer` wrote, without chapters."""
        ...

    def chapters(self, site_id: int, snapshot: SnapshotRecord) -> AsyncIterator[bytes]:
        """Read the chapters that a snapshot goes on from, each when it is asked for.

        Raises ChapterLostError where one is not there as it was saved.
        """
        ...

    async def drop_snapshot(self, site_id: int, position: int) -> None:
        """Remove a snapshot that turned out unreadable."""
        ...

    async def append_events(self, site_id: int, batch: EventBatch, kept: int) -> None:
        """Keep the events of a published view; those before the last `kept` batches may go."""
        ...

    async def read_events(self, site_id: int, after: int, limit: int) -> list[EventBatch]:
        """Return the batches of events after number `after`, at most `limit`, in order."""
        ...

    async def last_events(self, site_id: int) -> EventBatch | None:
        """Return the newest batch of events."""
        ...

    async def save_view(self, site_id: int, view: ViewRecord) -> None:
        """Keep the view of a site for the other processes' queries."""
        ...

    async def view(self, site_id: int, after: int) -> ViewRecord | None:
        """Return the view that was saved last, unless it is not after position `after`."""
        ...

    async def put_file(self, site_id: int, kind: FileKind, file: FileRecord) -> bool:
        """Keep a file of a site, in the place of one of its name; False where the site is gone."""
        ...

    async def read_file(self, site_id: int, kind: FileKind, name: str) -> FileRecord | None:
        """Return a file with its data."""
        ...

    async def files(self, site_id: int, kind: FileKind) -> list[FileRecord]:
        """Return the files of a kind, oldest first, without their data."""
        ...

    async def delete_file(self, site_id: int, kind: FileKind, name: str) -> bool:
        """Remove a file; False where there is none of that name."""
        ...

    def subscribe_news(self, listener: NewsListener) -> None:
        """Have `listener` told of views, events, questions and answers that were saved."""
        ...

    async def post_question(self, key: str, question: bytes) -> None:
        """Put a question to the process that maps."""
        ...

    async def question(self, key: str) -> bytes | None:
        """Return a question that is not answered yet."""
        ...

    async def post_answer(self, key: str, answer: bytes) -> None:
        """Answer it."""
        ...

    async def take_answer(self, key: str) -> bytes | None:
        """Return the answer and forget both; None while there is none."""
        ...

    async def claim_mapping(self, *, wait: bool) -> Claim:
        """Become the one process that maps.

        Raises ClaimedError where another is and `wait` is false.
        """
        ...

    async def tokens(self) -> list[TokenRecord]:
        """Return all bearer tokens, revoked ones included."""
        ...
