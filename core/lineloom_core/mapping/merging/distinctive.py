"""How much a place stands out among those of its own component, where the truth is known.

Two robots in two rooms that look alike produce matches as good as two robots in one room. What
tells them apart is the rest of the building: if a place is found again, almost as well, where it
certainly is not, then finding it in another robot's map proves little. This is the thesis's
distinguishability (§5.1) for whole places, and why a symmetric hall or a corridor of equal bays
is not joined on looks.
"""

from __future__ import annotations

from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.drift import reach
from lineloom_core.places import Place, evidence_elsewhere


def is_distinctive(site: SiteMap, candidate: Constraint) -> bool:
    """Whether the match is clearly better than any mistaken one known of either place."""
    need = candidate.evidence / site.config.join.distinctive
    return not any(
        _looks_like(site, site.places[number], other, need)
        for number in (candidate.place_a, candidate.place_b)
        for other in site.places.values()
        if site.same_component(other.anchor, site.places[number].anchor)
    )


def _looks_like(site: SiteMap, place: Place, other: Place, need: float) -> bool:
    """Whether there is more evidence than `need` for another relative pose than the known one."""
    first, second = (other, place) if other.id < place.id else (place, other)
    known = site.pose(first.anchor).between(site.pose(second.anchor))
    config, sigmas = site.config.recognition, site.config.wide_loops.most_sigmas
    memory = site.memory
    # From what is had soonest to what takes long and is seldom asked.
    for tables, drift in (
        (memory.hypotheses, site.rough_drift),
        (memory.look_alikes, site.rough_drift),
        (memory.look_alikes, site.drift),
    ):
        apart = first is not second
        slack = reach(drift(first.anchor, second.anchor), sigmas) if apart else 0.0
        if evidence_elsewhere(tables(first, second), known, config, slack=slack) <= need:
            return False
    return True
