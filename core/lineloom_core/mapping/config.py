"""All parameters of a site's mapper in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from lineloom_core.features import ExtractionConfig
from lineloom_core.fusion import FusionConfig
from lineloom_core.fusion.persistence import PersistenceConfig
from lineloom_core.places.recognition import RecognitionConfig


@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """Parameters of the tracker; metres, radians, seconds.

    memory: keyframes in the local map; noisy_memory: in that of a robot whose noise figure (see
    `drift`) lies above noisy_above. keyframe_distance, keyframe_angle: how far to the next
    keyframe. least_fit: share of a scan that must lie on known surfaces; low, for a turn into a
    new room shows mostly new walls. enough_fit: below it the scan becomes a keyframe, since so
    much of it is new. most_conflict: share of it that may lie where the keyframe saw free space;
    of nearly 90,000 steps of simulated robots among people, none of the right ones had as much.
    noisy_conflict: the same for a robot whose lidar is noisy: what it sees contradicts itself.
    patience: unfit scans in a row before the track is given up. longest_gap: silence after which
    the last step's velocity means nothing, and a scan must fit by gap_fit and conflict by at most
    gap_conflict. longest_silence: after which a robot may have been carried anywhere.
    prior_sigma [m, rad]: how far off a prediction is from one scan to the next (5 a second).
    least_isotropy: smaller over greater information on the position, under which the smaller counts
    as none. steady_share: of what fits, as much must have stood still to go by that alone.
    """

    memory: int = 8
    noisy_memory: int = 32
    noisy_above: float = 1.2
    keyframe_distance: float = 0.4
    keyframe_angle: float = math.radians(20.0)
    least_fit: float = 0.2
    enough_fit: float = 0.6
    most_conflict: float = 0.2
    noisy_conflict: float = 0.3
    patience: int = 4
    longest_gap: float = 0.6
    gap_fit: float = 0.5
    gap_conflict: float = 0.1
    longest_silence: float = 10.0
    prior_sigma: float = 0.1
    least_isotropy: float = 0.001
    steady_share: float = 0.5


@dataclass(frozen=True, slots=True)
class PlaceConfig:
    """span: metres of way in a place; stride: how far apart places begin; most_keyframes in one.

    shortlist: where more places than this are worth trying, the likeliest are.
    """

    span: float = 5.0
    stride: float = 2.5
    most_keyframes: int = 14
    least_keyframes: int = 4
    shortlist: int = 48


@dataclass(frozen=True, slots=True)
class NearLoopConfig:
    """Closing loops where the graph already knows that two keyframes are near each other.

    radius [m], angle [rad]: how near. apart [m]: way driven in between, less is no loop. reach_xy,
    reach_theta: how wrong the graph may be. The rest: checks as in recognition.
    """

    radius: float = 2.5
    angle: float = math.radians(70.0)
    apart: float = 12.0
    reach_xy: float = 0.4
    reach_theta: float = 0.1
    least_fit: float = 0.6
    most_conflict: float = 0.08
    every: int = 2


@dataclass(frozen=True, slots=True)
class JoinConfig:
    """Believing a set of candidate constraints.

    least_set: mutually consistent constraints that join two components. least_places: places in
    each, so that it is known what else looks alike. least_evidence: metres of wall in the set.
    lead: how many times the evidence of the best rival set. least_distinctive: constraints of the
    set whose evidence must be `distinctive` times that of any known mistake about their places.
    most_missing: share of what stood still for one robot and was not there for the other, over
    the places of the set; most_map_missing: over all places that would overlap and that drift has
    moved by less than `rigid_within` [m] against the set. most_doubt: the share of the set if
    `doubted_points` more were missing: three pieces of furniture, each in a few pairs of places.
    loop_gate: sigmas of drift within which a loop is believed.
    """

    least_set: int = 3
    least_places: int = 3
    least_evidence: float = 60.0
    lead: float = 2.0
    least_distinctive: int = 2
    distinctive: float = 1.3
    most_missing: float = 0.018
    most_map_missing: float = 0.03
    most_doubt: float = 0.045
    doubted_points: float = 180.0
    rigid_within: float = 0.1
    loop_gate: float = 3.0
    most_candidates: int = 64


@dataclass(frozen=True, slots=True)
class DoubtConfig:
    """When what was believed is withdrawn.

    most_compared: places that a new one is held against. most_missing: share of what stood still
    for one track and is missing for another, beyond the usual, over at least `least_compared` pairs
    of places and `least_points` points. most_strain [m], most_turn [rad]: how far the solved graph
    may be from what a loop says. A place with at least `place_points` judged is right up to
    `place_right` missing, and wrong from `place_wrong` on; `wrong_in_a_row` of them after a right
    one mean that tracking slipped. slip [m]: how far aside a place may be found again before it is
    another one. jump_missing: what may be missing between places two on along one track, over at
    least jump_points points; real and simulated ones come to 7 % at most, jumps to 10 and more.
    """

    most_compared: int = 6
    least_compared: int = 6
    least_points: int = 2000
    most_missing: float = 0.08
    most_strain: float = 0.5
    most_turn: float = 0.12
    place_points: int = 600
    place_right: float = 0.03
    place_wrong: float = 0.1
    wrong_in_a_row: int = 2
    slip: float = 1.5
    jump_missing: float = 0.1
    jump_points: int = 400


@dataclass(frozen=True, slots=True)
class ThinningConfig:
    """When places and their keyframes are let go.

    most_alike: places kept within `radius` [m] and `angle` [rad] of each other. apart: metres that
    a robot drives on before any of its latest track is let go.
    """

    most_alike: int = 3
    radius: float = 2.5
    angle: float = math.radians(60.0)
    apart: float = 20.0


@dataclass(frozen=True, slots=True)
class MapperConfig:
    """Parameters of `SiteMapper`; the defaults are those that every figure was measured with."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig)
    places: PlaceConfig = field(default_factory=PlaceConfig)
    recognition: RecognitionConfig = field(default_factory=RecognitionConfig)
    near_loops: NearLoopConfig = field(default_factory=NearLoopConfig)
    join: JoinConfig = field(default_factory=JoinConfig)
    doubt: DoubtConfig = field(default_factory=DoubtConfig)
    thinning: ThinningConfig = field(default_factory=ThinningConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    persistence: PersistenceConfig = field(default_factory=PersistenceConfig)
    checkpoint_every: int = 256
    """Keyframes at least from one `Checkpoints` to the next."""
    chapter: int = 256
    """Keyframes in a chapter of the `History`."""
    least_fit_late: float = 0.6
    """Share of a late scan that must lie on its neighbours' surfaces."""
