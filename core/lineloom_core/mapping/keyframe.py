"""A scan that stays: a node of the pose graph."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.geometry import Pose
from lineloom_core.matching.local_map import Cloud
from lineloom_core.scan import Scan


@dataclass(frozen=True, eq=False)
class Step:
    """How a keyframe was tracked from the one before it on its track.

    T_previous_this; information: 3x3 in the tangent at this one, as the graph takes it; drift:
    covariance there, as measured; checks: the tracker's figures.
    """

    previous: int
    T_previous_this: Pose
    information: NDArray[np.float64]
    drift: NDArray[np.float64]
    checks: dict[str, float]


@dataclass(frozen=True, eq=False)
class Keyframe:
    """One kept scan.

    scan: counter-clockwise, mount inversion already undone. track: the run of tracking without a
    break that it belongs to. T_track_laser: where the tracker put it; the graph knows better.
    step: None for the first of a track. version: number of the log entry that brought it.
    trusted: False where its lidar's geometry is certainly wrong: no place is made of it.
    Features and cloud are functions of the scan; a snapshot leaves them out.
    """

    id: int
    robot: str
    track: int
    scan: Scan
    T_track_laser: Pose
    step: Step | None
    version: int
    extraction: ExtractionConfig = field(repr=False)
    trusted: bool = True

    @cached_property
    def features(self) -> ScanFeatures:
        """Lines, ends, edges and points of the scan."""
        return extract_features(self.scan, self.extraction)

    @cached_property
    def cloud(self) -> Cloud:
        """The points with normals, for registration."""
        return Cloud.of(self.features)

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        state.pop("features", None)
        state.pop("cloud", None)
        return state
