"""Site maps laid by hand: keyframes exactly where the test wants them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from lineloom_core.features import ExtractionConfig
from lineloom_core.geometry import Pose
from lineloom_core.mapping.constraint import Constraint, step_information
from lineloom_core.mapping.keyframe import Keyframe
from lineloom_core.mapping.robot_record import Track
from lineloom_core.mapping.site_map import SiteMap
from lineloom_core.places import Glimpse, Place
from lineloom_core.simulation import SimulatedScan
from numpy.typing import NDArray


def lay_track(
    site: SiteMap,
    scans: Sequence[SimulatedScan],
    poses: Sequence[Pose] | None = None,
    *,
    robot: str = "r",
    begin: Pose | None = None,
) -> list[int]:
    """Make a track with a keyframe of every scan; return their ids.

    poses: T_track_laser of each, the true ones if None. begin: where the track begins in the
    component's frame.
    """
    begin = begin or Pose.identity()
    if poses is None:
        poses = [scans[0].true_pose.between(s.true_pose) for s in scans]
    track = Track(site.number("track"), robot)
    site.tracks[track.id] = track
    for simulated, pose in zip(scans, poses, strict=True):
        frame = Keyframe(
            id=site.number("keyframe"),
            robot=robot,
            track=track.id,
            scan=simulated.scan,
            T_track_laser=pose,
            extraction=ExtractionConfig(),
        )
        site.keyframes[frame.id] = frame
        site.add_node(frame.id, begin @ pose)
        _append(site, track, frame)
    return list(track.keyframes)


def _append(site: SiteMap, track: Track, frame: Keyframe) -> None:
    if not track.keyframes:
        track.travelled.append(0.0)
    else:
        last = site.keyframes[track.keyframes[-1]]
        T_last_new = last.T_track_laser.between(frame.T_track_laser)
        track.travelled.append(track.travelled[-1] + np.hypot(T_last_new.x, T_last_new.y))
        link(site, last.id, frame.id, T_last_new, kind="sequential", state="accepted")
    track.keyframes.append(frame.id)


def link(
    site: SiteMap,
    a: int,
    b: int,
    T_a_b: Pose,
    *,
    kind: str = "rendezvous",
    state: str = "candidate",
    evidence: float = 50.0,
    places: tuple[int, int] = (-1, -1),
    information: NDArray[np.float64] | None = None,
) -> Constraint:
    """Add a constraint between two keyframes."""
    made = Constraint(
        id=site.new_constraint_id(),
        kind=kind,  # type: ignore[arg-type]
        state=state,  # type: ignore[arg-type]
        keyframe_a=a,
        keyframe_b=b,
        T_a_b=T_a_b,
        information=step_information(np.diag([1e6, 1e6, 1e7]), (0.15, 0.05))
        if information is None
        else information,
        reason="made by hand",
        place_a=places[0],
        place_b=places[1],
        evidence=evidence,
    )
    site.add_constraint(made)
    return made


def lay_places(site: SiteMap, keyframes: Sequence[int], size: int = 8) -> list[Place]:
    """Cut a track into places of `size` keyframes, half of them shared with the next place."""
    made = []
    for begin in range(0, len(keyframes) - size + 1, size // 2):
        members = [site.keyframes[k] for k in keyframes[begin : begin + size]]
        anchor = members[size // 2]
        glimpses = [
            Glimpse(k.id, k.features, k.cloud, anchor.T_track_laser.between(k.T_track_laser))
            for k in members
        ]
        place = Place.of(site.number("place"), anchor.track, anchor.id, glimpses)
        site.places[place.id] = place
        made.append(place)
    return made


def thinned(scans: Sequence[SimulatedScan], step: float = 0.4) -> list[SimulatedScan]:
    """Every scan that lies `step` metres or 20 degrees from the one kept before."""
    kept = [scans[0]]
    for s in itertools.islice(scans, 1, None):
        T = kept[-1].true_pose.between(s.true_pose)
        if np.hypot(T.x, T.y) >= step or abs(T.theta) >= np.radians(20.0):
            kept.append(s)
    return kept
