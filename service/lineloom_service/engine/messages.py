"""What travels between the service and a worker.

run: the number of the site's start that a message belongs to; answers from an earlier start are
no longer of interest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.snapshot import Snapshot

from lineloom_service.engine.view_parts import Parts
from lineloom_service.observation.durations import Durations
from lineloom_service.store.records import LogEntry


@dataclass(frozen=True, slots=True)
class Chapter:
    """Keep this for the start of the site that comes next. Chapters come in order."""

    site: int
    run: int
    data: bytes


@dataclass(frozen=True, slots=True)
class StartSite:
    """Host a site. state: of a snapshot that goes on from the chapters that came before.

    parameters: of a mapper that begins with nothing; a snapshot has its own.
    """

    site: int
    run: int
    position: int
    state: bytes | None
    parameters: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Feed:
    """Map these entries; afterwards the site is at `through`. publish: show the map right then."""

    site: int
    run: int
    entries: tuple[LogEntry, ...]
    through: int
    caught_up: bool
    publish: bool = False


@dataclass(frozen=True, slots=True)
class TakeSnapshot:
    """Answer with the mapper's state, without the first `known` chapters of its history."""

    site: int
    run: int
    known: int


@dataclass(frozen=True, slots=True)
class Ask:
    """Answer a question about the map; nothing changes. question: a method of the mapper."""

    site: int
    run: int
    question: str
    arguments: tuple[object, ...]


@dataclass(frozen=True, slots=True)
class StopSite:
    """Host a site no longer."""

    site: int


Order = Chapter | StartSite | Feed | TakeSnapshot | Ask | StopSite


@dataclass(frozen=True, slots=True)
class Ready:
    """The worker is warm."""


@dataclass(frozen=True, slots=True)
class ChapterTaken:
    """A chapter has arrived."""

    site: int
    run: int


@dataclass(frozen=True, slots=True)
class Started:
    """The site is hosted. failure: why not."""

    site: int
    run: int
    failure: str | None = None


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


@dataclass(frozen=True, slots=True)
class EncodedView:
    """A `View` as it travels."""

    site: int
    run: int
    position: int
    parts: Parts


@dataclass(frozen=True, slots=True)
class ViewFailed:
    """The mapper could not show the site as it is after the entry at `position`."""

    site: int
    run: int
    position: int
    reason: str


@dataclass(frozen=True, slots=True)
class Stopped:
    """The site is hosted no longer: nothing more comes of it."""

    site: int


@dataclass(frozen=True, slots=True)
class SnapshotTaken:
    """The snapshot after all that was fed, its state compressed. failure: why there is none."""

    site: int
    run: int
    snapshot: Snapshot | None = None
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class Answered:
    """The answer to a question. failure: why there is none."""

    site: int
    run: int
    value: object = None
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class Failed:
    """The mapper raised; the worker has dropped the site."""

    site: int
    run: int
    position: int
    reason: str


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
