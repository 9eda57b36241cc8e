"""A scan that stays: a node of the pose graph."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.features import ExtractionConfig, ScanFeatures, extract_features
from lineloom_core.features._kernels import VAR_OFFSET
from lineloom_core.geometry import Pose
from lineloom_core.lately import UsedLately
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.scan_name import ScanName
from lineloom_core.matching.local_map import Cloud
from lineloom_core.scan import Scan

_DERIVED_KEPT = 2048
"""Keyframes whose features and points stay in memory; another one's are made in 0.1 ms."""


@storable("step")
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

    def then(self, following: Step) -> Step:
        """Both steps as one; covariances are carried to its end, to first order."""
        A = following.T_previous_this.inverse().adjoint()
        covariance = A @ np.linalg.inv(self.information) @ A.T
        information = np.linalg.inv(covariance + np.linalg.inv(following.information))
        drift = A @ self.drift @ A.T + following.drift
        return Step(
            previous=self.previous,
            T_previous_this=self.T_previous_this @ following.T_previous_this,
            information=0.5 * (information + information.T),
            drift=0.5 * (drift + drift.T),
            checks=_worst(self.checks, following.checks),
        )


def _worst(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
    """The lower fit and the higher of other figures; the lower gap, so that the step is held to
    what each of its parts came up to.
    """
    pick = {"fit": min, "gap": min}
    return {name: pick.get(name, max)(a[name], b[name]) for name in a if name in b}


@storable("keyframe")
@dataclass(frozen=True, eq=False)
class Keyframe:
    """One kept scan.

    scan: counter-clockwise, mount inversion already undone. track: the run of tracking without a
    break that it belongs to. T_track_laser: where the tracker put it; the graph knows better.
    step: None for the first of a track. version: number of the log entry that brought it.
    trusted: False where its lidar's geometry is certainly wrong: no place is made of it.
    joined: the step leads over keyframes that the map has let go. repeat: see `ScanName`.
    Features and cloud are functions of the scan: kept for the keyframes used last, made anew for
    the others.
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
    joined: bool = False
    repeat: int = 0

    @cached_property
    def scan_name(self) -> ScanName:
        """What its scan is called in any replay."""
        return ScanName(self.robot, self.scan.session, self.scan.seq, self.repeat)

    @cached_property
    def name(self) -> str:
        """What it is called outside: `id` is a number of this replay alone."""
        return id_of("keyframe", self.scan_name)

    @cached_property
    def segments(self) -> NDArray[np.float64]:
        """Its lines as the map takes them: ends x1, y1, x2, y2 and sigma [m], shape (n, 5)."""
        lines = self.features.lines
        return np.column_stack([lines[:, :4], np.sqrt(lines[:, VAR_OFFSET])])

    @property
    def features(self) -> ScanFeatures:
        """Lines, ends, edges and points of the scan."""
        return _features(self)

    @property
    def cloud(self) -> Cloud:
        """The points with normals, for registration."""
        return _cloud(self)


_features = UsedLately[Keyframe, ScanFeatures](
    lambda f: extract_features(f.scan, f.extraction), _DERIVED_KEPT
)
_cloud = UsedLately[Keyframe, Cloud](lambda f: Cloud.of(f.features), _DERIVED_KEPT)
