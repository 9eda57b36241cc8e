"""What a keyframe saw, as the lines of the map are made of it: kept from view to view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.lately import KeptWithin
from lineloom_core.mapping.facts.keyframe import Keyframe

_MOST_BYTES = 192 * 2**20
"""That is 16,000 keyframes of 360 beams; of others it is worked out anew for each view."""


@dataclass(frozen=True, eq=False, slots=True)
class Seen:
    """lines (n, 12): see `ScanFeatures`. points, normals (m, 2): see `Cloud`. beams (m,)."""

    lines: NDArray[np.float64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    beams: NDArray[np.int32]

    @staticmethod
    def by(keyframe: Keyframe) -> Seen:
        """Return what a keyframe saw."""
        features, cloud = keyframe.features, keyframe.cloud
        beams = features.beams.astype(np.int32)
        return Seen(features.lines, cloud.points, cloud.normals, beams)

    @property
    def size(self) -> int:
        """Bytes in memory."""
        return sum(a.nbytes for a in (self.lines, self.points, self.normals, self.beams))


seen_by = KeptWithin[Keyframe, Seen](Seen.by, lambda seen: seen.size, _MOST_BYTES)
"""What a keyframe saw."""
