"""What queries see of a site, in whichever process they are asked."""

from __future__ import annotations

import pickle
import zlib
from dataclasses import dataclass

from lineloom_core.mapping.site_view import SiteView

from lineloom_service.store.records import Skip, ViewRecord


@dataclass(frozen=True, slots=True)
class Published:
    """The view after the entry at `position`.

    scans, skipped: how many of the scans among 1..position are in the map, and how many not.
    skips: the entries among them that are left out for good.
    """

    position: int
    scans: int
    skipped: int
    view: SiteView
    skips: tuple[Skip, ...] = ()

    def record(self) -> ViewRecord:
        """Return this for the store. Takes time with the map's size."""
        return ViewRecord(self.position, zlib.compress(pickle.dumps(self, protocol=5), 1))


EMPTY_VIEW = SiteView(
    version=0,
    robots={},
    components=(),
    merged_into={},
    trajectories={},
    lines=(),
    keyframes=(),
    constraints=(),
)
NOTHING = Published(0, 0, 0, EMPTY_VIEW)
"""What is known of a site before its first view."""


def from_record(record: ViewRecord) -> Published:
    """Return what was stored. Raises ValueError where other code wrote it and it does not fit."""
    try:
        published = pickle.loads(zlib.decompress(record.data))
    except Exception as error:
        raise ValueError(f"unreadable view: {error}") from error
    if not isinstance(published, Published):
        raise ValueError("unreadable view: it is something else")
    return published
