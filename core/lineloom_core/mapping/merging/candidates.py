"""Candidate constraints: a new place looked for among all others.

Steps of `consider`: 1. recognise the new place among those of other components, and among those
of its own that may be here given the drift; 2. keep what passes as candidates; 3. let joining and
wide loops decide which sets of candidates to believe. Nothing is believed on a single match.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.drift import reach
from lineloom_core.mapping.facts.information import observed_information, turned
from lineloom_core.mapping.merging.component_merged import ComponentMerged
from lineloom_core.mapping.merging.joining import join
from lineloom_core.mapping.merging.wide_loops import close_wide_loops
from lineloom_core.places import Place, Recognition

_REFUSED_KEPT = 3
"""Refused recognitions that are kept per place, best first, so that they can be looked at."""


def consider(site: SiteMap, place: Place) -> tuple[list[ComponentMerged], bool]:
    """Look for a new place among all others; return the merges and whether poses moved."""
    likely = site.memory.index.shortlist(
        place, _worth_trying(site, place), site.config.places.shortlist
    )
    found = [_try(site, other, place) for other in likely]
    fresh = [c for c in found if c is not None and c.state == "candidate"]
    refused = [c for c in found if c is not None and c.state == "rejected"]
    refused.sort(key=lambda c: (-c.evidence, c.id))
    for constraint in (*fresh, *refused[:_REFUSED_KEPT]):
        site.add_constraint(constraint)
    merges: list[ComponentMerged] = []
    moved = False
    roots = sorted({site.component_root(c.keyframe_a) for c in fresh})
    for root in roots:
        if root == site.component_root(place.anchor):
            moved = close_wide_loops(site, place) or moved
        else:
            merged = join(site, root, place.anchor)
            if merged is not None:
                merges.append(merged)
                moved = True
    return merges, moved


def _worth_trying(site: SiteMap, place: Place) -> list[Place]:
    """Other components' places, and those of this one that may be here, given the drift."""
    tied = any(
        edge.kind != "sequential"
        for keyframe in place.keyframes
        for edge in site.graph.edges_at(keyframe)
    )
    here, most_sigmas = site.pose(place.anchor), site.config.wide_loops.most_sigmas
    chosen = []
    for other in site.places.values():
        if other.id == place.id:
            continue
        if not site.same_component(other.anchor, place.anchor):
            chosen.append(other)
            continue
        near = site.same_track(other.anchor, place.anchor) and not _lies_apart(site, other, place)
        if tied or near:
            continue
        beyond = site.pose(other.anchor).distance(here) - 4.0
        if beyond < 0.0 or beyond < reach(
            site.rough_drift(other.anchor, place.anchor), most_sigmas
        ):
            chosen.append(other)
    return chosen


def _lies_apart(site: SiteMap, other: Place, place: Place) -> bool:
    driven = site.driven_between(other.anchor, place.anchor)
    return driven > site.config.near_loops.apart + site.config.places.span


def _try(site: SiteMap, reference: Place, current: Place) -> Constraint | None:
    """Recognise one place in another; a plausible outcome becomes a candidate."""
    name = site.id_of("recognition", reference.id, current.id)
    if site.verdicts.barred(name) or name in site.verdicts.joined:
        return None
    found = site.memory.recognise(reference, current)
    if found.T_reference_current is None:
        return None
    same = site.same_component(reference.anchor, current.anchor)
    a, b, T_a_b = _nearest_keyframes(reference, current, found.T_reference_current)
    return Constraint(
        id=name,
        kind="loop" if same else "rendezvous",
        state="candidate" if found.plausible else "rejected",
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_b,
        information=_information_at(found, current, b),
        reason="waiting for others that agree" if found.plausible else found.reason,
        checks=found.checks,
        place_a=reference.id,
        place_b=current.id,
        evidence=found.evidence,
    )


def _nearest_keyframes(
    reference: Place, current: Place, T_reference_current: Pose
) -> tuple[int, int, Pose]:
    """The two keyframes that came nearest to each other: least lever, least drift inside."""
    best: tuple[float, int, int, Pose] | None = None
    for ka, pa in zip(reference.keyframes, reference.poses, strict=True):
        for kb, pb in zip(current.keyframes, current.poses, strict=True):
            there = T_reference_current @ pb
            d = pa.distance(there)
            if best is None or d < best[0]:
                best = d, ka, kb, pa.between(there)
    assert best is not None
    return best[1], best[2], best[3]


def _information_at(found: Recognition, current: Place, keyframe: int) -> NDArray[np.float64]:
    """Move the information from the current place's anchor to one of its keyframes."""
    assert found.T_reference_current is not None
    at_anchor = turned(found.information, found.T_reference_current.theta)
    T_anchor_keyframe = current.poses[current.keyframes.index(keyframe)]
    # xi_anchor = Ad(T_anchor_keyframe) xi_keyframe for a rigid place.
    A = T_anchor_keyframe.adjoint()
    return observed_information(A.T @ at_anchor @ A)
