"""All parameters of a site's mapper in one place, with what they mean and what they can be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from lineloom_core.codec import storable
from lineloom_core.features import ExtractionConfig
from lineloom_core.fusion import FusionConfig
from lineloom_core.fusion.persistence import PersistenceConfig
from lineloom_core.parameters import ParameterError, by_name, choice, parameter, with_values
from lineloom_core.places.recognition import RecognitionConfig


@storable("tracker-config")
@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """Following a robot from scan to scan.

    What scans conflict with is judged generously: of nearly 90,000 steps of simulated robots among
    people, none of the right ones had as much as `most_conflict`.
    """

    memory: int = parameter(8, "keyframes", "in the local map that scans are held against", 1, 1000)
    noisy_memory: int = parameter(
        32, "keyframes", "the same for a robot whose lidar is noisy", 1, 1000
    )
    noisy_above: float = parameter(
        1.2, "", "noise figure (see `drift`) from which a lidar is noisy"
    )
    keyframe_distance: float = parameter(0.4, "m", "how far to the next keyframe", 0.01)
    keyframe_angle: float = parameter(math.radians(20.0), "rad", "turn to the next keyframe", 0.01)
    least_fit: float = parameter(
        0.2, "share", "of a scan on known surfaces; a turn into a new room shows mostly new walls"
    )
    enough_fit: float = parameter(
        0.6, "share", "below it so much of the scan is new that it becomes a keyframe"
    )
    new_conflict: float = parameter(
        0.06, "share", "above it a scan that conflicts becomes a keyframe: it may have been carried"
    )
    most_conflict: float = parameter(
        0.2, "share", "of a scan that may lie where the keyframe saw free space"
    )
    noisy_conflict: float = parameter(
        0.3, "share", "the same for a noisy lidar, which contradicts itself"
    )
    patience: int = parameter(
        4, "scans", "unfit ones in a row before the track is given up", 1, 10_000
    )
    longest_gap: float = parameter(
        3.0, "intervals", "silence after which the last step's velocity means nothing", 1.0
    )
    gap_fit: float = parameter(0.5, "share", "`least_fit` after such a silence")
    gap_conflict: float = parameter(0.1, "share", "`most_conflict` after such a silence")
    longest_silence: float = parameter(
        60.0, "intervals", "after it a robot may have been carried anywhere", 1.0
    )
    farthest_gap: float = parameter(
        15.0, "intervals", "silence after which the pairwise matcher has to be sure", 1.0
    )
    least_wall: float = parameter(1.2, "m", "of wall that a searched scan fits on")
    least_matched: float = parameter(
        0.12, "share", "of all of a searched scan on known surfaces", 0.0, 1.0
    )
    most_misfit: float = parameter(11.0, "", "of a searched scan: see `step_search`")
    most_cost: float = parameter(
        12.0, "", "of it and of its surprise after a large turn: see `step_search`"
    )
    gap_lead: float = parameter(1.5, "", "`least_lead` after a gap")
    most_surprise: float = parameter(
        4.5, "", "of a step after small and even ones: minus its log-likelihood by `motion`"
    )
    least_lead: float = parameter(0.8, "", "in cost over any other spot: see `step_search`")
    prior_sigma: float = parameter(
        0.1, "m, rad", "how far off a prediction is in steady driving", 1e-4, 10.0
    )
    least_isotropy: float = parameter(
        0.001, "", "information across over along, below which there is none", 0.0, 1.0
    )
    steady_share: float = parameter(
        0.5, "share", "of what fits that must have stood still to go by that alone"
    )


@storable("place-config")
@dataclass(frozen=True, slots=True)
class PlaceConfig:
    """Places, which are recognised."""

    span: float = parameter(5.0, "m", "of way in a place", 0.1)
    stride: float = parameter(2.5, "m", "how far apart places begin", 0.1)
    most_keyframes: int = parameter(14, "keyframes", "in a place", 2, 1000)
    least_keyframes: int = parameter(4, "keyframes", "in a place", 1, 1000)
    shortlist: int = parameter(48, "places", "the likeliest, where more are worth trying", 1)


@storable("near-loop-config")
@dataclass(frozen=True, slots=True)
class NearLoopConfig:
    """Loops where the graph already knows that two keyframes are near each other."""

    radius: float = parameter(2.5, "m", "how near")
    angle: float = parameter(math.radians(70.0), "rad", "how much turned")
    apart: float = parameter(12.0, "m", "way driven in between; less is no loop")
    reach_xy: float = parameter(0.4, "m", "how wrong the graph may be", 0.01)
    reach_theta: float = parameter(0.1, "rad", "how wrong the graph may be", 0.001)
    least_fit: float = parameter(0.6, "share", "of a keyframe on the other's surfaces")
    most_conflict: float = parameter(0.08, "share", "of it in the other's free space")
    every: int = parameter(2, "keyframes", "from one that is looked at to the next", 1)


@storable("wide-loop-config")
@dataclass(frozen=True, slots=True)
class WideLoopConfig:
    """Loops that come of recognising a place in its own component.

    One that corrects the graph by less than small_step and small_turn needs no other.
    """

    most_sigmas: float = parameter(
        3.0, "σ", "of drift that a loop may correct, so places are looked for within it", 0.01
    )
    least_agreeing: int = parameter(1, "constraints", "others that correct the graph alike")
    slack: float = parameter(0.3, "m", "between two that do, besides the drift in between")
    turn: float = parameter(0.1, "rad", "between two that do")
    small_step: float = parameter(0.5, "m", "a correction that needs no other")
    small_turn: float = parameter(0.08, "rad", "a correction that needs no other")


@storable("join-config")
@dataclass(frozen=True, slots=True)
class JoinConfig:
    """Believing a set of candidate constraints, which joins two components."""

    most_false: float = parameter(
        0.02, "share", "how probable it may be that the set is false: see `join_odds`"
    )
    least_set: int = parameter(2, "constraints", "mutually consistent ones in the set", 1)
    least_evidence: float = parameter(20.0, "m", "of wall that the set rests on")
    least_distinctive: int = parameter(1, "constraints", "of the set that have to be distinctive")
    distinctive: float = parameter(
        1.3, "", "evidence of a distinctive place, times that of any known mistake about it", 1e-3
    )
    most_missing: float = parameter(
        0.08, "share", "of what stood still that the places of the set miss of each other"
    )
    most_map_missing: float = parameter(
        0.03, "share", "the same over all places that would overlap and that drift has not moved"
    )
    rigid_within: float = parameter(
        0.1, "m", "places count for `most_map_missing` that drift has moved less against the set"
    )
    most_candidates: int = parameter(64, "constraints", "that sets are made of", 1, 4096)


@storable("doubt-config")
@dataclass(frozen=True, slots=True)
class DoubtConfig:
    """When what was believed is withdrawn.

    Steps at which tracking jumped unseen conflict by 6 to 19 %. Across right ones 8 % at most are
    missing, in real buildings and among people; across jumps between furnished rooms 14 to 40 %.
    """

    most_compared: int = parameter(6, "places", "that a new one is held against")
    least_compared: int = parameter(6, "pairs", "of places that two tracks are judged by", 1)
    least_points: int = parameter(2000, "points", "that two tracks are judged by", 1)
    most_missing: float = parameter(
        0.08, "share", "of what stood still that two tracks miss of each other, beyond the usual"
    )
    most_strain: float = parameter(
        0.5, "m", "how far the solved graph may be from what a loop says"
    )
    most_turn: float = parameter(
        0.12, "rad", "how far the solved graph may be from what a loop says"
    )
    place_points: int = parameter(600, "points", "that a place is judged by", 1)
    place_right: float = parameter(0.03, "share", "missing of a place that is right")
    place_wrong: float = parameter(0.1, "share", "missing of a place that is wrong")
    wrong_in_a_row: int = parameter(2, "places", "after a right one: tracking slipped", 1)
    slip: float = parameter(
        1.5, "m", "how far aside a place may be found again before it is another one"
    )
    jump_conflict: float = parameter(
        0.03, "share", "of a keyframe where the one before saw free space: its step is suspected"
    )
    jump_missing: float = parameter(
        0.12, "share", "missing across a step, geometric mean of both ways: the robot jumped"
    )
    jump_points: int = parameter(40, "points", "each way, that a jump is judged by", 1)


@storable("thinning-config")
@dataclass(frozen=True, slots=True)
class ThinningConfig:
    """When places and their keyframes are let go."""

    most_alike: int = parameter(3, "places", "kept within `radius` and `angle` of each other", 2)
    radius: float = parameter(2.5, "m", "within which places are alike")
    angle: float = parameter(math.radians(60.0), "rad", "within which places are alike")
    apart: float = parameter(
        20.0, "m", "that a robot drives on before any of its latest track is let go"
    )


@storable("localise-config")
@dataclass(frozen=True, slots=True)
class LocaliseConfig:
    """Finding where a scan was taken (`localise`); it changes no map."""

    recognition: RecognitionConfig = field(
        default_factory=lambda: RecognitionConfig(least_explained=3.0, coarse_keep=12)
    )
    spots: int = parameter(
        10, "hypotheses", "that are held against all that is known around them", 1, 1000
    )
    surround: float = parameter(8.0, "m", "how far around a hypothesis keyframes count", 0.1)
    most_keyframes: int = parameter(16, "keyframes", "of them at most", 1, 1000)
    least_matched: float = parameter(40.0, "points", "(cells of 0.1 m) on known surfaces")
    least_explained: float = parameter(0.3, "share", "of the query on known surfaces")
    most_conflict: float = parameter(0.15, "share", "that may contradict")
    least_margin: float = parameter(0.15, "share", "of its evidence that the best one leads by")
    least_information: float = parameter(
        2.0e3, "1/m²", "the least on the translation, as in recognition"
    )
    least_places: int = parameter(
        3, "places", "in the component and its neighbours, to know what else looks alike"
    )
    least_score: float = parameter(0.9, "share", "how sure a unique answer must be")


@storable("mapper-config")
@dataclass(frozen=True, slots=True)
class MapperConfig:
    """Parameters of `SiteMapper`; the defaults are those that every figure was measured with."""

    extraction: ExtractionConfig = field(default_factory=ExtractionConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig)
    places: PlaceConfig = field(default_factory=PlaceConfig)
    recognition: RecognitionConfig = field(default_factory=RecognitionConfig)
    near_loops: NearLoopConfig = field(default_factory=NearLoopConfig)
    wide_loops: WideLoopConfig = field(default_factory=WideLoopConfig)
    join: JoinConfig = field(default_factory=JoinConfig)
    doubt: DoubtConfig = field(default_factory=DoubtConfig)
    thinning: ThinningConfig = field(default_factory=ThinningConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    persistence: PersistenceConfig = field(default_factory=PersistenceConfig)
    localise: LocaliseConfig = field(default_factory=LocaliseConfig)
    matcher: Literal["lineloom", "thesis"] = choice(
        "lineloom",
        "what follows a robot from scan to scan; thesis: that one's line segment matcher alone",
        ("lineloom", "thesis"),
    )
    checkpoint_every: int = parameter(
        256, "keyframes", "at least from one checkpoint to the next", 1
    )
    chapter: int = parameter(256, "keyframes", "in a chapter of the history", 1, 1_000_000)
    least_fit_late: float = parameter(0.6, "share", "of a late scan on its neighbours' surfaces")


_ORDERED = (
    ("tracker.memory", "tracker.noisy_memory"),
    ("places.least_keyframes", "places.most_keyframes"),
    ("recognition.cell", "recognition.half"),
    ("doubt.place_right", "doubt.place_wrong"),
    ("persistence.near", "persistence.far"),
    ("localise.recognition.cell", "localise.recognition.half"),
)
"""The first of each pair is at most the second."""


def config_from(given: Mapping[str, Any], base: MapperConfig | None = None) -> MapperConfig:
    """Return `base` (the defaults) with the parameters that are given, nested by name.

    Raises ParameterError, which names all that are unknown or that cannot be so.
    """
    config, wrong = with_values(base or MapperConfig(), given)
    named = dict(by_name(given))
    for less, more in _ORDERED:
        low, high = _get(config, less), _get(config, more)
        if low <= high or {less, more} & wrong.keys():
            continue
        if less in named:
            wrong[less] = f"is {low:g}, and {more} only {high:g}"
        else:
            wrong[more] = f"is {high:g}, and {less} already {low:g}"
    if wrong:
        raise ParameterError(wrong)
    return config


def _get(config: Any, name: str) -> float:
    for part in name.split("."):
        config = getattr(config, part)
    return float(config)
