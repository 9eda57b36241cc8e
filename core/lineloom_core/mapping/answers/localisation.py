"""The answer to "where is this scan?"."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lineloom_core.check import Limit
from lineloom_core.codec import storable
from lineloom_core.geometry import Pose

LocalisationVerdict = Literal["unique", "ambiguous", "unknown"]


@storable("pose-hypothesis")
@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """Where the scan may have been taken.

    pose: T_map_laser in the component's map frame. covariance: (3, 3) over x, y, theta in the
    map's axes, of the scan against the map around it: the map's own uncertainty is not in it.
    score: how sure, 0..1, that it is right. checks: figure by name; limits: what each is held to.
    """

    component: str
    pose: Pose
    covariance: NDArray[np.float64]
    score: float
    checks: dict[str, float]
    limits: dict[str, Limit] = field(default_factory=dict)


@storable("localisation")
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
