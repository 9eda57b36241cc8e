"""Second thoughts: what a new place shows to be wrong about what was believed."""

from __future__ import annotations

from lineloom_core.mapping.constraint import Constraint
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.places import Place


def contradicted_by(site: SiteMap, place: Place) -> tuple[Constraint, ...]:
    """Accepted constraints that are not to be believed any more, given the new place."""
    return ()
