"""Second thoughts: what a new place shows to be wrong about what was believed.

Steps of `contradicted_by`: 0. where the track's own places before are contradicted, the robot has
jumped (`jumps`); 1. hold the new place against those of other tracks that the map puts around it,
and add up what is missing; 2. where a track was right and then is wrong, tracking has
slipped: name the step; 3. where too much of what stood still is missing between two tracks, the
meeting that they rest on was false: name its whole set; 4. name loops that the solved graph does
not bear out. What is named is withdrawn, and the history gone through without it.
"""

from __future__ import annotations

import itertools

import numpy as np

from lineloom_core.checks import DOUBTED
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.refusals import is_approved
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.merging.jumps import jump
from lineloom_core.mapping.merging.overlap import count_steady_nearby, usual_missing
from lineloom_core.mapping.merging.withdrawal import is_doubted, withdrawn
from lineloom_core.places import Place, count_steady, missing_share

TrackPair = tuple[str, str]


def contradicted_by(site: SiteMap, place: Place) -> tuple[Constraint, ...]:
    """Accepted constraints that are not to be believed any more, given the new place."""
    jumped = jump(site, place)
    if jumped is not None:
        return (jumped,)
    counts = _compare(site, place)
    slipped = _slip(site, place, counts)
    if slipped is not None:
        return (slipped,)
    for pair in counts:
        false = _false_meeting(site, pair)
        if false:
            return false
    return _strained(site, place)


def _compare(site: SiteMap, place: Place) -> dict[TrackPair, tuple[int, int]]:
    """Step 1; return what this place adds, by pair of tracks."""
    here = site.pose(place.anchor)
    own = site.track(place.anchor).id
    near = sorted(
        (here.distance(site.pose(other.anchor)), other.id)
        for other in site.places_around(place.anchor, site.config.places.span)
        if site.track(other.anchor).id != own
    )
    news: dict[TrackPair, tuple[int, int]] = {}
    for _, number in near[: site.config.doubt.most_compared]:
        other = site.places[number]
        theirs = site.track(other.anchor).id
        matched, missing = _held_against(site, other, place)
        pair = (min(own, theirs), max(own, theirs))
        before = site.overlaps.get(pair, (0, 0, 0))
        site.overlaps[pair] = (before[0] + matched, before[1] + missing, before[2] + 1)
        so_far = news.get(pair, (0, 0))
        news[pair] = (so_far[0] + matched, so_far[1] + missing)
    return news


def _slip(
    site: SiteMap, place: Place, counts: dict[TrackPair, tuple[int, int]]
) -> Constraint | None:
    """Step 2: the step at which tracking slipped, if the place is off where it was right before.

    A meeting that was false was never right; a robot that agreed with the others' maps and then
    does not, two places running, has slipped in between: where its steps knew least.
    """
    config = site.config.doubt
    matched, missing = (sum(c[i] for c in counts.values()) for i in (0, 1))
    if matched + missing < config.place_points:
        return None
    track, share = site.track(place.anchor), missing_share(matched, missing)
    if share <= config.place_right:
        track.right_until, track.wrong_since = place.id, 0
        return None
    figures = {"slip_missing": share}
    if track.right_until is None or not is_doubted(site, figures):
        return None
    track.wrong_since += 1
    if track.wrong_since < config.wrong_in_a_row:
        return None
    steps = [
        step
        for k in track.kept
        if track.right_until < k <= place.id
        and (step := site.step(k)) is not None
        and not is_approved(site, step)
    ]
    if not steps:
        return None
    weakest = min(steps, key=lambda c: float(np.linalg.eigvalsh(c.information[:2, :2])[0]))
    return withdrawn(site, weakest, figures)


def _held_against(site: SiteMap, older: Place, newer: Place) -> tuple[int, int]:
    """Steady points that both saw and that one missed, where the map puts the two places.

    Where the newer place is recognised in the older one a little aside, tracking has slipped since
    they met: that is no fault of the meeting.
    """
    T = site.pose(older.anchor).between(site.pose(newer.anchor))
    found = site.memory.recognise(older, newer)
    aside = found.T_reference_current
    if found.plausible and aside is not None and aside.distance(T) < site.config.doubt.slip:
        return count_steady(older, newer, aside)
    return count_steady_nearby(older, newer, T)


def _false_meeting(site: SiteMap, pair: TrackPair) -> tuple[Constraint, ...]:
    """Step 3: the weakest meeting between two tracks, if their maps contradict each other."""
    config = site.config.doubt
    matched, missing, compared = site.overlaps[pair]
    if compared < config.least_compared or matched + missing < config.least_points:
        return ()
    share = missing_share(matched, missing)
    if not is_doubted(site, {"pair_missing": share}):
        return ()
    share -= usual_missing(site, [p for p in site.places.values() if _on(site, p, pair)])
    figures = {"pair_missing": share}
    if not is_doubted(site, figures):
        return ()
    return tuple(withdrawn(site, c, figures) for c in _weakest_meeting(site, *pair))


def _on(site: SiteMap, place: Place, pair: TrackPair) -> bool:
    return site.track(place.anchor).id in pair


def _weakest_meeting(site: SiteMap, track_a: str, track_b: str) -> list[Constraint]:
    """The set with the least evidence among those that link two tracks; what is approved stays."""
    import networkx as nx  # takes longer than all else that a worker starts with; rarely wanted

    meetings: dict[tuple[str, ...], list[Constraint]] = {}
    links = nx.Graph()
    for c in site.constraints.values():
        if c.kind in ("rendezvous", "operator") and c.state == "accepted":
            meetings.setdefault(c.consistency_set, []).append(c)
            ends = (site.track(c.keyframe_a).id, site.track(c.keyframe_b).id)
            links.add_edge(*ends, meeting=c.consistency_set)
    if track_a not in links or track_b not in links or not nx.has_path(links, track_a, track_b):
        return []
    way = nx.shortest_path(links, track_a, track_b)
    on_the_way = {links.edges[a, b]["meeting"]: None for a, b in itertools.pairwise(way)}
    doubtful = [m for m in on_the_way if not any(is_approved(site, c) for c in meetings[m])]
    if not doubtful:
        return []
    return meetings[min(doubtful, key=lambda m: (sum(c.evidence for c in meetings[m]), m))]


def _strained(site: SiteMap, place: Place) -> tuple[Constraint, ...]:
    """Step 4: accepted loops that the graph has solved far away from what they say."""
    root = site.component_root(place.anchor)
    if site.unsolved.get(root):
        return ()
    errors = site.graph.errors()
    off, turned = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
    doubted = DOUBTED.against_each(site.config.doubt, {"strain_m": off, "strain_rad": turned})
    edges = list(site.graph.edges.values())
    return tuple(
        withdrawn(
            site,
            site.constraints[edges[i].id],
            {"strain_m": float(off[i]), "strain_rad": float(turned[i])},
        )
        for i in np.flatnonzero(doubted)
        if edges[i].kind == "loop"
        and site.component_root(edges[i].node_a) == root
        and not is_approved(site, site.constraints[edges[i].id])
    )
