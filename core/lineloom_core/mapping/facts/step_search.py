"""A robot's next pose where tracking is not sure of it: by evidence, from no pose.

Steps of `search_step`: 1. seeds: what is expected, what the pairwise matcher says of the latest
keyframes, and an exhaustive search around; 2. register each on the local map; 3. judge it: how
much of the scan lies on known surfaces, how much in what the latest keyframes saw as free and the
other way round, how surprising the step is, and whether the matcher backs it; 4. see along which
direction the best could slide or about which point turn (`freedom`), and how far it leads any other
that is no slide or turn of it.

Where the matcher is certain of the latest keyframe and nothing speaks against it, step 1 ends
there; it asks the keyframes before only where what was found so far has a rival or could slide.
What matters most is in the order of design §6: the matcher on several keyframes, the motion, free
space both ways.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from lineloom_core.features import ScanFeatures
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.facts.freedom import Freedom, find_freedom
from lineloom_core.mapping.facts.motion import PAUSE, Expected
from lineloom_core.mapping.facts.recent import Recent
from lineloom_core.matching._sweep import Sweep
from lineloom_core.matching.local_map import Cloud
from lineloom_core.matching.matcher import LineMatcher
from lineloom_core.matching.result import MatchResult
from lineloom_core.matching.spots import Latest, Spot, Spotter
from lineloom_core.timing import timed

_COMPARED = 4  # latest keyframes that the matcher compares a scan with, and whose free space counts
_COMPARED_BACK = 2  # of them, those whose walls must not stand in the scan's free space
_REACH = 2.5  # m: of the exhaustive search
_SEEDS = 8  # of it
_SURPRISE = 1.5  # weight of it
_BACKED = {"match": 5.0, "weak": 1.5, "": 0.0}
_BACKWARDS = math.radians(100.0), 7.5  # rad, and what a turn beyond it costs
_APART, _TURNED = 0.3, 0.15  # m, rad: from here on another spot is a rival
_CERTAIN = 6.0  # misfit up to which a certain match needs no rival
_NO_SURPRISE = 2.0
_CLEAR = 8.0, 6.0  # misfit, and lead, from which on no further keyframe is compared
_NO_RIVAL = 99.0

_MATCHER = LineMatcher()
_Match = tuple[MatchResult, Pose]


@dataclass(frozen=True, slots=True)
class Searched:
    """best: the spot that is believed if any. lead: over the best rival that is no slide of it.

    cost: what speaks against it, how unlike the last steps it is among that. A spot where all that
    a scan shows is new would come to about 12: often that is what a weak find is, above all one
    half a turn off in a corridor. freedom: the motion in the track's frame that nothing speaks
    against, None if there is none. backing: what the matcher says of it, "match", "weak" or "".
    """

    best: Spot
    cost: float
    lead: float
    freedom: Freedom | None
    backing: str


@timed("search")
def search_step(
    recent: Recent, features: ScanFeatures, cloud: Cloud, last: Pose, expected: Expected
) -> Searched:
    """Find where a scan was taken; `last`: the pose of the scan before."""
    spotter = spotter_of(recent, features, cloud)
    judge = partial(_judged, last=last, expected=expected)
    matches = _matches(recent, features, 0, 1)
    spots = spotter.settle(at @ r.best for r, at in matches if r.verdict == "match" and r.best)
    if expected.gap > PAUSE or not _is_certain(spots, expected):
        seeds = [*expected.predictions, last, *_of_matches(matches)]
        seeds += recent.map.search_around(cloud, last, reach=_REACH, most=_SEEDS)
        spots = spotter.settle(seeds)
        if expected.gap > PAUSE or not _is_clear(spotter, judge(spots, matches=matches)):
            more = _matches(recent, features, 1, _COMPARED)
            matches += more
            spots += spotter.settle(_of_matches(more))
    found = judge(spots, matches=matches)
    best, freedom = found[0][1], find_freedom(spotter, found[0][1])
    cost = best.misfit + _SURPRISE * expected.surprise(best.pose)
    return Searched(best, cost, _lead(found, freedom), freedom, _backing(best.pose, matches))


def spotter_of(recent: Recent, features: ScanFeatures, cloud: Cloud) -> Spotter:
    """What judges spots of a scan by the latest keyframes."""
    latest = Latest.of(recent.last(_COMPARED))
    return Spotter(recent.map, latest, Sweep.of(features), cloud, _COMPARED_BACK)


def _is_certain(spots: Sequence[Spot], expected: Expected) -> bool:
    """Whether the latest keyframe alone says where a scan was taken, and nothing speaks against."""
    return any(
        spot.misfit < _CERTAIN and expected.surprise(spot.pose) < _NO_SURPRISE for spot in spots
    )


def _is_clear(spotter: Spotter, found: Sequence[tuple[float, Spot]]) -> bool:
    """Whether the best leads so far, any way that it could slide, that no keyframe changes it."""
    best = found[0][1]
    clear = best.misfit < _CLEAR[0] and _lead(found, None) > _CLEAR[1]
    return clear and find_freedom(spotter, best) is None


def _lead(found: Sequence[tuple[float, Spot]], freedom: Freedom | None) -> float:
    """How much less speaks against the first than against any other to which it is not free."""
    cost, best = found[0]
    rivals = (c for c, s in found[1:] if _is_rival(s.pose, best.pose, freedom))
    return min(rivals, default=cost + _NO_RIVAL) - cost


def _matches(recent: Recent, features: ScanFeatures, begin: int, end: int) -> list[_Match]:
    """What the matcher says of some of the latest keyframes, and where these are."""
    latest = recent.last(end)[begin:]
    return [(_MATCHER.match_prepared(other, features), at) for other, at in latest]


def _of_matches(matches: Iterable[_Match]) -> list[Pose]:
    seeds = []
    for result, at in matches:
        found = [] if result.best is None else [result.best]
        found += [a.T_reference_current for a in result.alternatives[:2]]
        seeds += [at @ T for T in found]
    return seeds


def _judged(
    spots: Sequence[Spot], last: Pose, expected: Expected, matches: Sequence[_Match]
) -> list[tuple[float, Spot]]:
    """Step 3: the spots with their costs, best first."""
    found = []
    for spot in spots:
        cost = spot.misfit + _SURPRISE * expected.surprise(spot.pose)
        if abs(angle_difference(spot.pose.theta, last.theta)) > _BACKWARDS[0]:
            cost += _BACKWARDS[1]
        found.append((cost - _BACKED[_backing(spot.pose, matches)], spot))
    return sorted(found, key=lambda row: row[0])


def _backing(pose: Pose, matches: Iterable[_Match]) -> str:
    """The best that any match says of a pose."""
    backing = ""
    for result, at in matches:
        if result.T_reference_current is None:
            continue
        there = at @ result.T_reference_current
        if abs(angle_difference(pose.theta, there.theta)) > 0.07:
            continue
        if result.verdict == "match" and pose.distance(there) < _APART:
            return "match"
        if result.weak_direction is not None:
            axis = at.theta + result.weak_direction
            if _across(pose, there, axis) < _APART:
                backing = "weak"
    return backing


def _across(a: Pose, b: Pose, axis: float) -> float:
    return abs(-math.sin(axis) * (a.x - b.x) + math.cos(axis) * (a.y - b.y))


def _is_rival(a: Pose, b: Pose, freedom: Freedom | None) -> bool:
    near = b if freedom is None else freedom.nearest(a)
    return abs(angle_difference(a.theta, near.theta)) > _TURNED or a.distance(near) > _APART
