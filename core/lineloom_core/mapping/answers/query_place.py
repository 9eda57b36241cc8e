"""A place made of the scans that somebody asks about, without putting them into any map."""

from __future__ import annotations

from collections.abc import Sequence

from lineloom_core.features import extract_features
from lineloom_core.geometry import Pose
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.facts.trackers import new_tracker
from lineloom_core.matching.local_map import Cloud
from lineloom_core.places import Glimpse, Place, Seen
from lineloom_core.scan import Scan


def query_place(scans: Sequence[Scan], config: MapperConfig) -> Place | None:
    """Track a run of one robot's scans and make a place of it, in the frame of the latest one.

    The anchor is the index of that scan: scans that show nothing, or that somebody stood before,
    are passed over. Where the track breaks, what came before counts no more. Of a long run the last
    metres count, as in any place. None where no scan shows anything.
    """
    tracker, seen = new_tracker(config), list[tuple[Glimpse, bool]]()
    for number, scan in enumerate(scans):
        features = extract_features(scan.counter_clockwise(), config.extraction)
        if len(features.points) == 0:
            continue
        cloud = Cloud.of(features)
        tracked = tracker.track(features, cloud, scan.stamp, scan.odometry)
        if tracked.status == "lost":
            tracker, seen = new_tracker(config), []
            tracked = tracker.track(features, cloud, scan.stamp, scan.odometry)
        if tracked.pose is not None:
            seen.append((Glimpse(number, Seen(features, cloud), tracked.pose), tracked.is_keyframe))
    if not seen:
        return None
    members = _members(seen, config)
    latest = members[-1].T_anchor_laser
    glimpses = tuple(
        Glimpse(g.keyframe, g.sight, latest.between(g.T_anchor_laser)) for g in members
    )
    return Place(-1, -1, glimpses[-1].keyframe, glimpses)


def _members(seen: list[tuple[Glimpse, bool]], config: MapperConfig) -> list[Glimpse]:
    """The latest scan and the keyframes of the last metres before it, oldest first."""
    latest, _ = seen[-1]
    chosen: list[Glimpse] = [latest]
    driven, last = 0.0, latest.T_anchor_laser
    for glimpse, is_keyframe in reversed(seen[:-1]):
        if not is_keyframe:
            continue
        here: Pose = glimpse.T_anchor_laser
        driven += last.distance(here)
        if driven > config.places.span:
            break
        chosen.append(glimpse)
        last = here
    while len(chosen) > config.places.most_keyframes:
        chosen = chosen[::2]
    return chosen[::-1]
