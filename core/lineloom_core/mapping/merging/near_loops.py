"""Loops where the graph already knows that two keyframes are near each other.

A keyframe near an older one of the same component is registered against that one's surroundings,
from the pose that the graph predicts and within a small window. That cannot join components and
cannot glue similar places together: a window of a few decimetres holds no second corridor.
"""

from __future__ import annotations

from lineloom_core.checks import NEAR_LOOP
from lineloom_core.geometry import Pose, angle_difference
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.refusals import is_barred
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.facts.information import observed_information, turned
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.matching.free_space import judge_sweeps
from lineloom_core.matching.local_map import Cloud, LocalMap


def close_near_loop(site: SiteMap, keyframe: int) -> Constraint | None:
    """Try to tie a keyframe to an older part of its component; return the accepted constraint."""
    older = _partner(site, keyframe)
    if older is None:
        return None
    name = site.id_of("near", older, keyframe)
    if name in site.graph.edges or site.verdicts.barred(name):
        return None
    found = _register(site, older, keyframe)
    if found is None or is_barred(site, found):
        return None
    site.add_constraint(found)
    return found


def _partner(site: SiteMap, keyframe: int) -> int | None:
    """The nearest keyframe that looks the same way and is not of the recent past."""
    config = site.config.near_loops
    here = site.pose(keyframe)
    best: tuple[float, int] | None = None
    for other, distance in site.nearby(keyframe, config.radius):
        if other > keyframe or not _apart(site, other, keyframe):
            continue
        turn = abs(angle_difference(site.pose(other).theta, here.theta))
        if turn > config.angle:
            continue
        cost = distance + turn
        if best is None or cost < best[0]:
            best = cost, other
    return best[1] if best else None


def _apart(site: SiteMap, older: int, newer: int) -> bool:
    same = site.same_track(older, newer)
    return not same or site.driven_between(older, newer) > site.config.near_loops.apart


def _register(site: SiteMap, older: int, newer: int) -> Constraint | None:
    """Register the newer keyframe in the surroundings of the older one and check the outcome."""
    config = site.config.near_loops
    a, b = site.keyframes[older], site.keyframes[newer]
    surroundings = LocalMap.build(_clouds_around(site, a))
    predicted = site.pose(older).between(site.pose(newer))
    guess, _ = surroundings.search(
        b.cloud, predicted, reach_xy=config.reach_xy, reach_theta=config.reach_theta
    )
    found = surroundings.register(b.cloud, guess)
    checks = {
        "fit": found.fit,
        "conflict_share": judge_sweeps(a.features, b.features, found.pose).conflict_share,
        "moved_m": found.pose.distance(predicted),
        "turned_rad": abs(angle_difference(found.pose.theta, predicted.theta)),
    }
    if NEAR_LOOP.against(config, checks):
        return None
    return Constraint(
        id=site.id_of("near", older, newer),
        kind="loop",
        state="accepted",
        keyframe_a=older,
        keyframe_b=newer,
        T_a_b=found.pose,
        information=observed_information(turned(found.information, found.pose.theta)),
        reason="the graph predicted it and the scans agree",
        checks=checks,
        evidence=found.matched * 0.05,
    )


def _clouds_around(site: SiteMap, keyframe: Keyframe) -> list[tuple[Cloud, Pose]]:
    T_keyframe_map = site.pose(keyframe.id).inverse()
    rows = []
    for k in site.track(keyframe.id).neighbours(keyframe.id, 3):
        T: Pose = T_keyframe_map @ site.pose(k)
        rows.append((site.keyframes[k].cloud, T))
    return rows
