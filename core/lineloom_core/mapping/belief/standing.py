"""Verdicts on what is not there: an operator's word, carried over to the keyframes of this replay.

Steps of `standing`: 1. find the keyframe that each named scan was placed by; 2. go back along its
track for as long as the same story might be told earlier: a set of constraints that joins two maps
comes up over a few places; 3. carry the relative pose there, as tracking has it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lineloom_core.geometry import Pose
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.sameness import NEAR
from lineloom_core.mapping.config import PlaceConfig
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.facts.robot_record import RobotRecord
from lineloom_core.mapping.facts.scan_name import ScanName


def standing(
    claim: Claim, history: History, robots: Mapping[str, RobotRecord], config: PlaceConfig
) -> Constraint | None:
    """What a verdict on a claim bars or approves when it comes up; None of scans nobody knows."""
    earlier = {"step": 0.0, "near": NEAR, "recognition": config.span + 2.0 * config.stride,
               "operator": 0.0}  # fmt: skip
    ends = [
        _anchored(name, history, robots, earlier[claim.origin])
        for name in (claim.scan_a, claim.scan_b)
    ]
    if ends[0] is None or ends[1] is None:
        return None
    (a, T_a_scan), (b, T_b_scan) = ends[0], ends[1]
    return Constraint(
        id=claim.constraint,
        kind=claim.kind,
        state="candidate",
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_scan @ claim.T_a_b @ T_b_scan.inverse(),
        information=np.zeros((3, 3)),
        reason="named by an operator, and not measured here",
        claim=claim,
    )


def said_of(
    claim: Claim, history: History, robots: Mapping[str, RobotRecord]
) -> tuple[int, int, Pose] | None:
    """The two keyframes that a claim is of, and T_a_b between them; None of scans nobody knows."""
    ends = [_anchored(name, history, robots, 0.0) for name in (claim.scan_a, claim.scan_b)]
    if ends[0] is None or ends[1] is None:
        return None
    (a, T_a_scan), (b, T_b_scan) = ends[0], ends[1]
    return a, b, T_a_scan @ claim.T_a_b @ T_b_scan.inverse()


def unplaced_ends(
    claim: Claim, history: History, robots: Mapping[str, RobotRecord]
) -> list[ScanName]:
    """The scans that a claim names and of whose session nothing is in the map."""
    ends = (claim.scan_a, claim.scan_b)
    return [name for name in ends if _anchored(name, history, robots, 0.0) is None]


def _anchored(
    name: ScanName, history: History, robots: Mapping[str, RobotRecord], earlier: float
) -> tuple[int, Pose] | None:
    """A keyframe up to so many metres before a scan, and T_keyframe_scan as tracked."""
    record = robots.get(name.robot)
    placed = record and record.placed.find(name.session, name.seq)
    near = (
        history[placed.keyframe] if placed else history.nearest(name.robot, name.session, name.seq)
    )
    if near is None:
        return None
    first = _before(history, near, earlier)
    T_first_near = first.T_track_laser.between(near.T_track_laser)
    return first.id, T_first_near @ (placed.T_keyframe_laser if placed else Pose.identity())


def _before(history: History, keyframe: Keyframe, most: float) -> Keyframe:
    """The first keyframe of a track from which it is at most so many metres to this one."""
    chain = history.before(keyframe)
    driven, last = 0.0, keyframe
    for other in chain:
        driven += other.T_track_laser.distance(last.T_track_laser)
        if driven > most:
            break
        last = other
    return last
