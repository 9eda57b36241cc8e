"""Measuring what an operator says: that two keyframes are near each other, lying roughly so.

Steps of `measured`: 1. take what is known around either as one place; 2. look for the pose at which
the two fit best near where the operator laid them, or anywhere, where nothing was said of that;
3. measure what speaks for it and against it, there and wherever else the two maps would overlap.
What speaks against it is told and refuses nothing: a word stands above the evidence.
"""

from __future__ import annotations

import numpy as np

from lineloom_core.checks import JOINED, RECOGNISED
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.place_making import make_place
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.information import observed_information, turned
from lineloom_core.mapping.merging.overlap import missing_elsewhere, places_near, usual_missing
from lineloom_core.matching.local_map import LocalMap, Registration
from lineloom_core.places import (
    Place,
    check_alignment,
    count_steady,
    evidence_for,
    hypotheses,
    missing_share,
    recognise,
)

_REACH_M, _REACH_RAD = 1.5, 0.3
"""How far from where an operator laid it the best fit is looked for."""

_LEAST_FIT = 0.3
"""Share of a place that must lie on the other for the matcher to know better than the operator."""

_BY_HAND = np.diag([0.3**-2, 0.3**-2, 0.05**-2])
"""Information of what was laid by hand, and is not seen by both."""


def measured(
    site: SiteMap, history: History, claim: Claim, a: int, b: int, T_a_b: Pose | None
) -> Constraint | None:
    """What a claim on two keyframes comes to; T_a_b: as the operator laid them, None if not said.

    None where nothing was said and the two have nothing in common.
    """
    (reference, T_A_a), (current, T_B_b) = (place_around(site, history, k) for k in (a, b))
    if T_a_b is None:
        known = recognise(reference, current, site.config.recognition)
        if known.T_reference_current is None:
            return None
        guess, figures = known.T_reference_current, {"margin": known.checks["margin"]}
    else:
        guess, figures = T_A_a @ T_a_b @ T_B_b.inverse(), {}
    found = _best_fit(site, reference, current, guess)
    fits = found is not None
    T_A_B = guess if found is None else found.pose
    figures |= _figures(site, reference, current, guess, found) if found is not None else {}
    T_a_b = T_A_a.inverse() @ T_A_B @ T_B_b
    A = T_B_b.inverse().adjoint()
    information = (
        _BY_HAND if found is None else observed_information(turned(found.information, T_A_B.theta))
    )
    figures |= _of_maps(site, a, b, T_a_b)
    return Constraint(
        id=claim.constraint,
        kind="operator",
        state="accepted",
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_b,
        information=information if found is None else A.T @ information @ A,
        reason=_reason(site, figures, fits=fits),
        checks=figures,
        consistency_set=(claim.constraint,),
        evidence=figures.get("evidence", 0.0),
        claim=claim,
    )


def place_around(site: SiteMap, history: History, keyframe: int) -> tuple[Place, Pose]:
    """What its track shows within half a place's span of a keyframe, and T_place_keyframe."""
    track, config = site.track(keyframe), site.config.places
    at = track.travelled[track.position(keyframe)]
    near = {
        k
        for k, way in zip(track.keyframes, track.travelled, strict=True)
        if abs(way - at) <= 0.5 * config.span
    }
    members = sorted(near | {keyframe})
    while len(members) > config.most_keyframes:
        members = [k for i, k in enumerate(members) if i % 2 == 0 or k == keyframe]
    place = make_place(members, history)
    return place, place.poses[place.keyframes.index(keyframe)]


def objections(site: SiteMap, figures: dict[str, float]) -> tuple[str, ...]:
    """What speaks against a join, in words, most telling last."""
    said = [
        row.objection.format(figures[row.name])
        for checks in (RECOGNISED, JOINED)
        for row in checks.rows
        if row.name in figures
        and not row.limit(getattr(site.config, checks.section), figures).holds
    ]
    return tuple(dict.fromkeys(said))


def _reason(site: SiteMap, figures: dict[str, float], *, fits: bool) -> str:
    against = objections(site, figures)
    if not fits:
        against = ("the scans have too little in common there to measure it", *against)
    if not against:
        return "said by an operator, and the scans agree"
    return f"said by an operator; against it: {', '.join(against)}"


def _best_fit(site: SiteMap, reference: Place, current: Place, guess: Pose) -> Registration | None:
    """The best registration near a guess; None where too little lies on each other."""
    around = LocalMap.build((g.sight.cloud, g.T_anchor_laser) for g in reference.glimpses)
    searched, _ = around.search(current.surface, guess, reach_xy=_REACH_M, reach_theta=_REACH_RAD)
    starts = [guess, searched]
    starts += [
        Pose.from_array(row[:3]) for row in hypotheses(reference, current, site.config.recognition)
    ]
    tried = [reference.register(current, T) for T in starts if _is_near(T, guess)]
    fitting = [r for r in tried if r.fit >= _LEAST_FIT and _is_near(r.pose, guess)]
    return max(fitting, key=lambda r: _evidence(reference, current, r), default=None)


def _is_near(T: Pose, guess: Pose) -> bool:
    turn = abs(angle_difference(T.theta, guess.theta))
    return T.distance(guess) <= 1.5 * _REACH_M and turn <= 1.5 * _REACH_RAD


def _evidence(reference: Place, current: Place, found: Registration) -> float:
    checks = check_alignment(reference, current, found)
    return evidence_for(checks["matched"], checks["conflict"])


def _figures(
    site: SiteMap, reference: Place, current: Place, guess: Pose, found: Registration
) -> dict[str, float]:
    checks = check_alignment(reference, current, found)
    return {
        **checks,
        "evidence": evidence_for(checks["matched"], checks["conflict"]),
        "own_conflict": reference.own_conflict + current.own_conflict,
        "missing_share": missing_share(*count_steady(reference, current, found.pose)),
        "snapped_m": found.pose.distance(guess),
        "snapped_rad": abs(angle_difference(found.pose.theta, guess.theta)),
    }


def _of_maps(site: SiteMap, a: int, b: int, T_a_b: Pose) -> dict[str, float]:
    """What the two maps miss of each other, or how far a loop would correct one map."""
    if site.same_component(a, b):
        off = T_a_b.between(site.pose(a).between(site.pose(b)))
        return {"corrected_m": float(np.hypot(off.x, off.y)), "corrected_rad": abs(off.theta)}
    near_a, near_b = (places_near(site, [site.resting.on(k)[0]]) for k in (a, b))
    T_A_B = site.pose(a) @ T_a_b @ site.pose(b).inverse()
    there = {p.anchor: site.pose(p.anchor) for p in near_a}
    there |= {p.anchor: T_A_B @ site.pose(p.anchor) for p in near_b}
    usual = 0.5 * (usual_missing(site, near_a) + usual_missing(site, near_b))
    return {"map_missing": max(missing_elsewhere(site, near_a, near_b, there) - usual, 0.0)}
