"""The answer to "where is this scan?"."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.places import RecognitionConfig

LocalisationVerdict = Literal["unique", "ambiguous", "unknown"]


@dataclass(frozen=True, slots=True)
class LocaliseConfig:
    """Parameters of `localise`; metres, radians, shares 0..1.

    recognition: how places are matched. spots: hypotheses that are held against all that is known
    around them. same_distance, same_angle: within them, two hypotheses are one. surround: how far
    around a hypothesis keyframes count. most_keyframes: of them at most. least_matched: points
    (cells of 0.1 m) on known surfaces, least_explained: their share of the query, without which
    nothing is known; most_conflict: the share that may contradict. least_margin: lead over the
    best rival. least_information: [1/m^2] as in recognition. least_places: places in the component
    and its neighbours, so that it is known what else looks alike. least_score: how sure a "unique"
    must be.
    """

    recognition: RecognitionConfig = field(
        default_factory=lambda: RecognitionConfig(least_explained=3.0, coarse_keep=12)
    )
    spots: int = 10
    same_distance: float = 0.5
    same_angle: float = 0.15
    surround: float = 8.0
    most_keyframes: int = 16
    least_matched: float = 40.0
    least_explained: float = 0.3
    most_conflict: float = 0.15
    least_margin: float = 0.15
    least_information: float = 2.0e3
    least_places: int = 3
    least_score: float = 0.9


@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """Where the scan may have been taken.

    pose: T_map_laser in the component's map frame. covariance: (3, 3) over x, y, theta in the
    map's axes, of the scan against the map around it: the map's own uncertainty is not in it.
    score: how sure, 0..1, that it is right. checks: figure by name.
    """

    component: str
    pose: Pose
    covariance: NDArray[np.float64]
    score: float
    checks: dict[str, float]


@dataclass(frozen=True, eq=False)
class Localisation:
    """Hypotheses, best first, and what may be concluded from them.

    "unique": the first one is right; "ambiguous": several fit, or the position along one direction
    is not determined; "unknown": none fits well enough. reason: why, in words. scan: index of the
    scan that the poses are of, the latest one that shows anything and hangs together with those
    before it; None where there is none.
    """

    verdict: LocalisationVerdict
    reason: str
    scan: int | None = None
    hypotheses: tuple[PoseHypothesis, ...] = ()
