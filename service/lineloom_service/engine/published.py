"""What queries see of a site, in whichever process they are asked."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW

from lineloom_service.store.records import Skip


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

    @property
    def rank(self) -> tuple[int, bool]:
        """Of two views of a site that of the higher rank is shown: later, or settled."""
        return self.position, self.view.settled


NOTHING = Published(0, 0, 0, EMPTY_VIEW)
"""What is known of a site before its first view."""
