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
from lineloom_core.places import Place, evidence_elsewhere


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
    """Evidence for another relative pose of two places than the one that is known."""
    first, second = (other, place) if other.id < place.id else (place, other)
    known = site.pose(first.anchor).between(site.pose(second.anchor))
    slack = 3.0 * site.config.join.drift_rate[0] * site.way_between(first.anchor, second.anchor)
    table = site.memory.hypotheses(first, second)
    return evidence_elsewhere(table, known, site.config.recognition, slack=slack)
