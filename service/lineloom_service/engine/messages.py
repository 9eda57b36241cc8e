"""What travels between the service and a worker.

run: the number of the site's start that a message belongs to; answers from an earlier start are
no longer of interest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lineloom_core.codec import storable
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.snapshot import Snapshot

from lineloom_service.engine.view_parts import Parts
from lineloom_service.observation.durations import Durations
from lineloom_service.store.records import LogEntry


@storable("message-chapter")
@dataclass(frozen=True, slots=True)
class Chapter:
    """Keep this for the start of the site that comes next. Chapters come in order."""

    site: int
    run: int
    data: bytes


@storable("message-start-site")
@dataclass(frozen=True, slots=True)
class StartSite:
    """Host a site. state: of a snapshot that goes on from the chapters that came before.

    parameters: of a mapper that begins with nothing; a snapshot has its own. settled: its first
    view is to be.
    """

    site: int
    run: int
    position: int
    state: bytes | None
    parameters: Mapping[str, Any]
    settled: bool = False


@storable("message-feed")
@dataclass(frozen=True, slots=True)
class Feed:
    """Map these entries; afterwards the site is at `through`.

    publish: show the map right then. settled: at the optimum.
    """

    site: int
    run: int
    entries: tuple[LogEntry, ...]
    through: int
    caught_up: bool
    publish: bool = False
    settled: bool = False


@storable("message-take-snapshot")
@dataclass(frozen=True, slots=True)
class TakeSnapshot:
    """Answer with the mapper's state, without the first `known` chapters of its history."""

    site: int
    run: int
    known: int


@storable("message-ask")
@dataclass(frozen=True, slots=True)
class Ask:
    """Answer a question about the map; nothing changes. question: a method of the mapper.

    arguments: as `questions` writes them.
    """

    site: int
    run: int
    question: str
    arguments: bytes


@storable("message-stop-site")
@dataclass(frozen=True, slots=True)
class StopSite:
    """Host a site no longer."""

    site: int


Order = Chapter | StartSite | Feed | TakeSnapshot | Ask | StopSite


@storable("message-ready")
@dataclass(frozen=True, slots=True)
class Ready:
    """The worker is warm."""


@storable("message-chapter-taken")
@dataclass(frozen=True, slots=True)
class ChapterTaken:
    """A chapter has arrived."""

    site: int
    run: int


@storable("message-started")
@dataclass(frozen=True, slots=True)
class Started:
    """The site is hosted. failure: why not."""

    site: int
    run: int
    failure: str | None = None


@storable("message-fed")
@dataclass(frozen=True, slots=True)
class Fed:
    """A feed is mapped."""

    site: int
    run: int


@dataclass(frozen=True, slots=True)
class View:
    """The site as it is after the entry at `position`."""

    site: int
    run: int
    position: int
    view: SiteView


@storable("message-encoded-view")
@dataclass(frozen=True, slots=True)
class EncodedView:
    """A `View` as it travels."""

    site: int
    run: int
    position: int
    parts: Parts


@storable("message-view-failed")
@dataclass(frozen=True, slots=True)
class ViewFailed:
    """The mapper could not show the site as it is after the entry at `position`."""

    site: int
    run: int
    position: int
    reason: str


@storable("message-stopped")
@dataclass(frozen=True, slots=True)
class Stopped:
    """The site is hosted no longer: nothing more comes of it."""

    site: int


@storable("message-snapshot-taken")
@dataclass(frozen=True, slots=True)
class SnapshotTaken:
    """The snapshot after all that was fed, its state compressed. failure: why there is none."""

    site: int
    run: int
    snapshot: Snapshot | None = None
    failure: str | None = None


@storable("message-answered")
@dataclass(frozen=True, slots=True)
class Answered:
    """The answer to a question, as `questions` writes it. failure: why there is none."""

    site: int
    run: int
    value: bytes = b""
    failure: str | None = None


@storable("message-failed")
@dataclass(frozen=True, slots=True)
class Failed:
    """The mapper raised; the worker has dropped the site."""

    site: int
    run: int
    position: int
    reason: str


@storable("message-timed")
@dataclass(frozen=True, slots=True)
class Timed:
    """How long the worker's stages took since it last said so."""

    durations: Durations


Report = (
    Timed
    | Ready
    | ChapterTaken
    | Started
    | Fed
    | View
    | ViewFailed
    | SnapshotTaken
    | Answered
    | Failed
)
Sent = Report | EncodedView | Stopped
"""What a worker sends; `WorkerProcess` makes reports of it."""
