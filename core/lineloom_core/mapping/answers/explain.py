"""The evidence of a constraint, made anew from its keyframes when somebody asks.

Steps of `explain`: 1. lay both places (or both scans) into the frame of keyframe a; 2. pair lines
that lie on each other; 3. name the points of one that stand in free space of the other; 4. put
every figure beside its threshold; 5. of a recognition, name votes, runner-up and margin.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lineloom_core.check import Limit
from lineloom_core.checks import DOUBTED, JOINED, NEAR_LOOP, RECOGNISED, SAID, TRACKED, WIDE_LOOP
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.answers.evidence import Evidence, MatchedLines, RunnerUp
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.place_making import make_place
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.merging.operators_word import place_around
from lineloom_core.places import Place, conflicting_points, evidence_of, rivals

_SAME_ANGLE = 0.12  # rad
_SAME_DISTANCE = 0.25  # m
_LEAST_OVERLAP = 0.2  # m


def explain(site: SiteMap, history: History, constraint: Constraint) -> Evidence:
    """What speaks for a constraint and against it."""
    (reference, T_a_reference), (current, T_b_current) = (
        _seen_by(site, history, constraint, *end)
        for end in (
            (constraint.place_a, constraint.keyframe_a),
            (constraint.place_b, constraint.keyframe_b),
        )
    )
    T_a_current = constraint.T_a_b @ T_b_current
    lines_a, lines_b = _moved(T_a_reference, reference), _moved(T_a_current, current)
    T_reference_current = T_a_reference.between(T_a_current)
    votes, runner_up, margin = _rivals(site, constraint, T_a_reference, T_b_current)
    return Evidence(
        constraint=constraint.id,
        limits=_limits(constraint, site.config),
        matched=_matched(lines_a, lines_b),
        reference=lines_a,
        current=lines_b,
        conflicts=_conflicts(reference, current, T_reference_current, T_a_reference),
        votes=votes,
        runner_up=runner_up,
        margin=margin,
    )


def _seen_by(
    site: SiteMap, history: History, c: Constraint, place: int, keyframe: int
) -> tuple[Place, Pose]:
    """The place of a recognition, else what the keyframe alone shows; and T_keyframe_place.

    The history is asked: what is barred may rest on keyframes that the map has let go.
    """
    if c.kind == "operator" and site.knows(keyframe):
        around, T_around_keyframe = place_around(site, history, keyframe)
        return around, T_around_keyframe.inverse()
    known = site.places.get(place)
    if known is not None and keyframe in known.keyframes:
        return known, known.poses[known.keyframes.index(keyframe)].inverse()
    return make_place((keyframe,), history), Pose.identity()


def _limits(c: Constraint, config: MapperConfig) -> dict[str, Limit]:
    """What every figure was held to, for the way in which the constraint came about."""
    near = (TRACKED,) if c.kind == "sequential" else (NEAR_LOOP,)
    ways = near if c.place_a < 0 else (RECOGNISED, WIDE_LOOP, JOINED)
    if c.kind == "operator":
        ways = (RECOGNISED, JOINED, SAID)
    limits: dict[str, Limit] = {}
    for checks in (*ways, DOUBTED):
        limits |= checks.limits(getattr(config, checks.section), c.checks)
    return limits


def _moved(T: Pose, place: Place) -> NDArray[np.float64]:
    return T.transform(place.lines[:, :4].reshape(-1, 2)).reshape(-1, 4)


def _conflicts(
    reference: Place, current: Place, T_reference_current: Pose, T_a_reference: Pose
) -> NDArray[np.float64]:
    """Points of either place in free space of the other, in the frame of keyframe a."""
    there = conflicting_points(reference, current, T_reference_current)
    here = conflicting_points(current, reference, T_reference_current.inverse())
    T_a_current = T_a_reference @ T_reference_current
    return np.concatenate([T_a_current.transform(there), T_a_reference.transform(here)])


def _matched(
    reference: NDArray[np.float64], current: NDArray[np.float64]
) -> tuple[MatchedLines, ...]:
    """For every current line the reference line that it shares most of its length with."""
    found = []
    for line in current:
        pairs = [pair for other in reference if (pair := _pair(other, line)) is not None]
        if pairs:
            found.append(max(pairs, key=lambda pair: pair.overlap))
    return tuple(found)


def _pair(reference: NDArray[np.float64], current: NDArray[np.float64]) -> MatchedLines | None:
    """The two as one wall, facing the same way; None where they do not lie on each other."""
    p, q = reference[:2], reference[2:]
    u = (q - p) / max(float(np.hypot(*(q - p))), 1e-9)
    d = current[2:] - current[:2]
    angle = angle_difference(math.atan2(d[1], d[0]), math.atan2(u[1], u[0]))
    if abs(angle) > _SAME_ANGLE:
        return None
    ends = current.reshape(2, 2) - p
    distance = float(np.mean(ends @ np.array([-u[1], u[0]])))
    along = ends @ u
    overlap = float(min(np.dot(q - p, u), along.max()) - max(0.0, along.min()))
    if abs(distance) > _SAME_DISTANCE or overlap < _LEAST_OVERLAP:
        return None
    a, b = reference.tolist(), current.tolist()
    return MatchedLines(
        (a[0], a[1], a[2], a[3]), (b[0], b[1], b[2], b[3]), overlap, abs(distance), abs(angle)
    )


def _rivals(
    site: SiteMap, c: Constraint, T_a_reference: Pose, T_b_current: Pose
) -> tuple[float | None, RunnerUp | None, float | None]:
    """Votes, runner-up and margin, for a recognition."""
    if c.place_a not in site.places or c.place_b not in site.places:
        return None, None, None
    first, second = sorted((c.place_a, c.place_b))
    table = site.memory.hypotheses(site.places[first], site.places[second])
    T_reference_current = T_a_reference.inverse() @ c.T_a_b @ T_b_current
    turned = first != c.place_a
    said = T_reference_current.inverse() if turned else T_reference_current
    own, others = rivals(table, said, site.config.recognition)
    votes = None if own is None else float(own[4])
    if not len(others):
        return votes, None, c.checks.get("margin")
    T = Pose.from_array(others[0][:3])
    T = T_a_reference @ (T.inverse() if turned else T) @ T_b_current.inverse()
    runner_up = RunnerUp(T.x, T.y, T.theta, evidence_of(others[0]))
    return votes, runner_up, c.checks.get("margin")
