"""What the service needs of a storage, and nothing more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Concatenate, Literal, ParamSpec, Protocol, TypeVar

from sqlalchemy import Connection

from lineloom_service.store.database import Claim
from lineloom_service.store.records import SiteRecord
from lineloom_service.store.transaction import Transaction

P = ParamSpec("P")
T = TypeVar("T")

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

    What can be asked and done are plain functions: queries in `reads`, `snapshots`, `files` and
    `questions`, actions in `actions` and there as well; called as
    `await store.read(read_feed, site_id, 0, 100)`. An action is part of a commit that it shares
    with others, and raises before it has written anything or not at all.

    Whatever an `await` returned from is on disk. Names of sites and robots are unique among
    those that exist; a name that was deleted may be used again for something new. Everything
    raises StoreError where the storage fails.

    shared: other processes may use the same storage at the same time. One of all maps: it has a
    claim, and what it writes `as_engine` raises StoreError once the claim is lost.
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

    def subscribe_news(self, listener: NewsListener) -> None:
        """Have `listener` told of views, events, questions and answers that were saved."""
        ...

    async def sites(self) -> list[SiteRecord]:
        """All sites by name."""
        ...

    async def site(self, site: str) -> SiteRecord | None:
        """One site."""
        ...

    async def read(
        self, query: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Ask a query of one consistent state of the storage."""
        ...

    async def write(
        self, action: Callable[Concatenate[Transaction, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Do an action, in the order of the calls and in a commit that others share."""
        ...

    async def write_as_engine(
        self, action: Callable[Concatenate[Transaction, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Do an action that is the mapping process's alone."""
        ...

    async def write_apart(
        self, work: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Write what has nothing to do with the log, in a transaction that holds no scans up."""
        ...

    async def write_apart_as_engine(
        self, work: Callable[Concatenate[Connection, P], T], /, *args: P.args, **kwargs: P.kwargs
    ) -> T:
        """Write such a thing that is the mapping process's alone."""
        ...

    async def check(self) -> str | None:
        """Try whether scans can be taken; return why not. The last commits count as well."""
        ...

    def mapper_trouble(self) -> str | None:
        """Return why no other process seems to map; None where one does, or this one is to."""
        ...

    async def claim_mapping(self, *, wait: bool) -> Claim:
        """Become the one process that maps.

        Raises ClaimedError where another is and `wait` is false.
        """
        ...
