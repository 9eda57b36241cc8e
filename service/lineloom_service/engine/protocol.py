"""What the service needs of a place where mappers run, and nothing more."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.snapshot import Snapshot

from lineloom_service.observation.durations import Durations
from lineloom_service.store.records import LogEntry

ViewListener = Callable[[int, int, SiteView], None]
"""Called on the event loop with a site, its position and the view after the entry at position."""


FailureListener = Callable[[int, int, str], None]
"""Called on the event loop with a site, its position and why there is no view after the entry."""

DeathListener = Callable[[int], None]
"""Called with a site whose mapper is gone and has to be started again."""


@dataclass(frozen=True, slots=True)
class Remade:
    """A map that takes another's place. before: the view that was shown. why: it was made anew."""

    position: int
    view: SiteView
    making: str
    before: SiteView
    why: str


class MapperFailedError(Exception):
    """The mapper raised on the entry at `position`. The site has to be started again."""

    def __init__(self, position: int, reason: str) -> None:
        super().__init__(f"entry {position}: {reason}")
        self.position = position
        self.reason = reason


class ResumeFailedError(Exception):
    """A snapshot cannot be read: the site has to be started from another, or from nothing."""


class SnapshotFailedError(Exception):
    """The mapper could not be saved. The map is as it was, and the site goes on."""


class QuestionFailedError(Exception):
    """The mapper could not answer a question. The map is as it was."""


class WorkerDiedError(Exception):
    """The process that hosted the site is gone. The site has to be started again.

    position: the site's entry that it was working on, None where it was not this site's turn.
    killed: by a signal of somebody else (an operator, the kernel out of memory).
    """

    def __init__(self, position: int | None, reason: str, *, killed: bool) -> None:
        super().__init__(reason)
        self.position = position
        self.reason = reason
        self.killed = killed


class Engine(Protocol):
    """Hosts one mapper per site, each fed by one caller in the order of the log.

    site: a number that the caller gives to each; one that is made anew beside itself has two
    (`engine.making`).
    Every call about a site may raise WorkerDiedError.
    """

    async def start(self) -> None:
        """Begin, also after `stop`; it need not be ready yet."""
        ...

    async def stop(self) -> None:
        """End at once. What is worth keeping was asked for by `snapshot`."""
        ...

    def subscribe(self, listener: ViewListener) -> None:
        """Have `listener` told of published views."""
        ...

    def subscribe_failures(self, listener: FailureListener) -> None:
        """Have `listener` told of views that the mapper could not make."""
        ...

    def subscribe_deaths(self, listener: DeathListener) -> None:
        """Have `listener` told of sites whose mapper died, also of those that had nothing to do."""
        ...

    def not_ready(self) -> list[str]:
        """Return what is missing before mappers can run; empty when nothing is."""
        ...

    def trouble(self, site: int) -> str | None:
        """Return what is wrong with the place that hosts a site, None where all is well."""
        ...

    def durations(self) -> Durations:
        """Return how long the mappers' stages took so far."""
        ...

    async def start_site(
        self,
        site: int,
        position: int,
        state: bytes | None,
        chapters: AsyncIterator[bytes] | None = None,
        parameters: Mapping[str, Any] | None = None,
        *,
        settled: bool = False,
    ) -> None:
        """Host a site from a snapshot taken after the entry at `position`, or from nothing.

        state: as `snapshot` returned it. chapters: all that it goes on from, in order; one is read
        when the one before has arrived where the site is hosted, and what reading raises passes
        through. parameters: of a mapper that begins with nothing. settled: the view that is
        published first is to be. Replaces the site's mapper where there is one. Raises
        ResumeFailedError.
        """
        ...

    def feed(
        self,
        site: int,
        entries: Sequence[LogEntry],
        through: int,
        *,
        caught_up: bool,
        publish: bool = False,
        settled: bool = False,
    ) -> Awaitable[object]:
        """Send entries; what is returned is done when the mapper is through all of them.

        through: the position after them, which may be that of an entry left out. caught_up: there
        are no more for now. publish: the view at `through` comes before it is done, whatever the
        pace. settled: it is to be at the optimum, as what stands for a while becomes anyhow.
        Several feeds may be under way. Raises MapperFailedError.
        """
        ...

    async def snapshot(self, site: int, known: int = 0) -> Snapshot:
        """Return the mapper's state after all that was fed, compressed.

        known: how many chapters of its history are kept already: those from there on come with it.
        Raises SnapshotFailedError.
        """
        ...

    def ask(self, site: int, question: str, *arguments: object) -> Awaitable[Any]:
        """Ask the site's mapper something that changes nothing (`questions`).

        Answered after all that was fed before. Raises QuestionFailedError.
        """
        ...

    def stop_site(self, site: int) -> None:
        """Host a site no longer."""
        ...


class Recorder(Protocol):
    """Keeps what published views tell, beside the mapping."""

    async def told_of(self, site_id: int) -> str | None:
        """Return what the map was made with that was told of last (`Making.id`), None: nothing."""
        ...

    async def recorded_position(self, site_id: int) -> int:
        """Return the position up to which a site is recorded: its view there has to be published.

        Asked before a site is mapped.
        """
        ...

    async def recorded_settled(self, site_id: int) -> bool:
        """Return whether the view there was settled."""
        ...

    def on_view(self, site_id: int, position: int, view: SiteView, making: str) -> None:
        """Take a published view; never waits. making: what it was made with."""
        ...

    def on_remade(self, site_id: int, made: Remade) -> None:
        """Take the first view of a map that takes another's place; never waits."""
        ...

    async def settled(self, site_id: int) -> None:
        """Wait until what was taken is durable, within bounds."""
        ...

    def forget_site(self, site_id: int) -> None:
        """A site was deleted."""
        ...

    def release(self) -> None:
        """Another process records from now on."""
        ...

    async def stop(self) -> None:
        """Finish."""
        ...
