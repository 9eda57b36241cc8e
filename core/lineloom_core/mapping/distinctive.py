"""How much a place stands out among those of its own component, where the truth is known.

Two robots in two rooms that look alike produce matches as good as two robots in one room. What
tells them apart is the rest of the building: if a place is found again, almost as well, where it
certainly is not, then finding it in another robot's map proves little. This is the thesis's
distinguishability (§5.1) for whole places, and why a symmetric hall or a corridor of equal bays
is not joined on looks.
"""

from __future__ import annotations

from lineloom_core.mapping.constraint import Constraint
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.places import Place, alias_evidence


def is_distinctive(site: SiteMap, candidate: Constraint) -> bool:
    """Whether the match is clearly better than any mistaken one known of either place."""
    need = candidate.evidence / site.config.join.distinctive
    return all(
        _look_alike(site, site.places[place]) <= need
        for place in (candidate.place_a, candidate.place_b)
    )


def _look_alike(site: SiteMap, place: Place) -> float:
    """The most evidence [m] for finding the place elsewhere in its own component, or turned."""
    most = 0.0
    for other in site.places.values():
        if site.same_component(other.anchor, place.anchor):
            most = max(most, _pair(site, other, place))
    return most


def _pair(site: SiteMap, other: Place, place: Place) -> float:
    """Alias evidence of two places whose relative pose is known; asked once, then remembered."""
    key = (min(other.id, place.id), max(other.id, place.id))
    if key not in site.alias:
        known = site.pose(other.anchor).between(site.pose(place.anchor))
        rate = site.config.join.drift_rate[0]
        slack = 3.0 * rate * site.way_between(other.anchor, place.anchor)
        site.alias[key] = alias_evidence(other, place, known, slack, site.config.recognition)
    return site.alias[key]
