"""Aligning S_c over S_r and checking the matching line segments against one another (§5.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.config import ThesisConfig
from lineloom_core.matching.thesis.line_segments import LineSegments
from lineloom_core.matching.thesis.pairs import Match
from lineloom_core.matching.thesis.rotation import rotational_difference
from lineloom_core.matching.thesis.translation import Translation, translational_difference


@dataclass(frozen=True, slots=True)
class Alignment:
    """The pose difference and the pairs it rests on.

    pairs: the matching pairs left. discarded: those that contradicted the rest.
    """

    T_reference_current: Pose
    translation: Translation
    pairs: tuple[Match, ...]
    discarded: tuple[Match, ...]


def align(
    matching_pairs: Sequence[Match], L_r: LineSegments, L_c: LineSegments, config: ThesisConfig
) -> Alignment:
    """Compute the pose difference (Algorithms 8 and 9) and check the aligned pairs.

    After the alignment all pairs should be parallel and lie on each other within the error window
    (§6.3.1: 5 degrees and 10 cm). Departure: the text checks but does not say what then; here the
    pair that lies worst is discarded and the rest aligned anew, until all that are left agree or
    only two are left. With `discard` off, all pairs count, as in Algorithms 8 and 9.
    Raises ValueError where there is no pair.
    """
    pairs, discarded = list(matching_pairs), list[Match]()
    while True:
        theta = rotational_difference(pairs, L_r, L_c)  # §5.6.1
        t = translational_difference(pairs, L_r, L_c, theta, config)  # §5.6.2
        pose = Pose(t.x, t.y, theta)
        misfit = misfits(pairs, L_r, L_c.moved(pose), config)
        if not config.discard or len(pairs) <= 2 or misfit.max() <= 1.0:
            return Alignment(pose, t, tuple(pairs), tuple(discarded))
        discarded.append(pairs.pop(int(np.argmax(misfit))))


def misfits(
    pairs: Sequence[Match], L_r: LineSegments, aligned: LineSegments, config: ThesisConfig
) -> NDArray[np.float64]:
    """How badly the lines of each pair lie on each other, (n,); at most 1 inside the window.

    aligned: L_c in the frame of S_r. The greater of the angle and of the distance of the shorter
    line's middle from the longer line, both in units of the error window.
    """
    k, m = np.array(pairs, dtype=np.int64).T
    shorter_is_c = aligned.lengths[m] <= L_r.lengths[k]
    middle_r, middle_c = 0.5 * (L_r.s + L_r.e)[k], 0.5 * (aligned.s + aligned.e)[m]
    apart = np.where(shorter_is_c[:, None], middle_c, middle_r) - np.where(
        shorter_is_c[:, None], middle_r, middle_c
    )
    longer = np.where(shorter_is_c, L_r.directions[k], aligned.directions[m])
    distance = np.abs(np.cos(longer) * apart[:, 1] - np.sin(longer) * apart[:, 0])
    angle = np.abs(wrap_array(L_r.directions[k] - aligned.directions[m]))
    worst: NDArray[np.float64] = np.maximum(
        distance / config.windows.distance, angle / config.windows.angle
    )
    return worst
