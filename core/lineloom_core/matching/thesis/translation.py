"""The translational difference of two scans (§5.6.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.geometry.angles import wrap_array
from lineloom_core.matching.thesis.config import ThesisConfig
from lineloom_core.matching.thesis.line_segments import LineSegments, intersection
from lineloom_core.matching.thesis.pairs import Match
from lineloom_core.matching.thesis.rotation import precision_value


@dataclass(frozen=True, slots=True)
class Translation:
    """The translation of T_reference_current and what it rests on.

    x, y [m] in the reference frame. edges: number of common edges it is the mean of. spread:
    weighted rms distance of the single edges' translations from it [m]. undetermined: direction
    along which nothing fixes it [rad, 0..pi) in the reference frame; it is 0 along it. None where
    x and y are both known.
    """

    x: float
    y: float
    edges: int
    spread: float
    undetermined: float | None


def translational_difference(
    matching_pairs: Sequence[Match],
    L_r: LineSegments,
    L_c: LineSegments,
    theta: float,
    config: ThesisConfig,
) -> Translation:
    """Algorithm 9 for L_c turned by `theta` [rad], Algorithm 8's answer.

    Every two pairs (k, m), (u, v) of matching lines that are not parallel have a common edge:
    i_(k,u) in S_r and i_(m,v) in S_c; their difference is weighted by the smaller of the two
    precision values. Departures: divided by the sum of the weights, not by the count; weighted
    also by the sine squared between the lines, as an error of either moves a flat intersection by
    1 / sine; intersections flatter than `least_angle` are refused. Where no edge is left (a
    corridor), only the translation across is known and said to be.
    Raises ValueError where there is no pair.
    """
    if not matching_pairs:
        raise ValueError("no matching line segments, so no translational difference")
    turned = L_c.moved(Pose(0.0, 0.0, theta))
    k, m = np.array(matching_pairs, dtype=np.int64).T
    a, b = np.triu_indices(len(k), 1)
    i_r, sine_r = intersection(
        L_r.directions[k[a]], L_r.offsets[k[a]], L_r.directions[k[b]], L_r.offsets[k[b]]
    )
    i_c, sine_c = intersection(
        turned.directions[m[a]], turned.offsets[m[a]], turned.directions[m[b]], turned.offsets[m[b]]
    )
    precision = np.minimum(
        precision_value(L_r.lengths[k[a]], L_r.lengths[k[b]]),
        precision_value(L_c.lengths[m[a]], L_c.lengths[m[b]]),
    )
    sine = np.minimum(np.abs(sine_r), np.abs(sine_c))
    common = sine >= math.sin(config.primitives.least_angle)
    if not common.any():
        return _across(k, m, L_r, turned)
    weights = (precision * sine**2)[common]
    return _weighted_mean((i_r - i_c)[common], weights)


def _weighted_mean(steps: NDArray[np.float64], weights: NDArray[np.float64]) -> Translation:
    total = float(weights.sum())
    x, y = (weights @ steps / total).tolist()
    square = float(weights @ np.sum((steps - [x, y]) ** 2, axis=1)) / total
    return Translation(x, y, len(steps), math.sqrt(square), None)


def _across(
    k: NDArray[np.int64], m: NDArray[np.int64], L_r: LineSegments, turned: LineSegments
) -> Translation:
    """Translation of lines that are all parallel: across them, and 0 along them."""
    weights = precision_value(L_r.lengths[k], turned.lengths[m])
    total = float(weights.sum())
    doubled = wrap_array(2.0 * L_r.directions[k])
    s, c = float(weights @ np.sin(doubled)), float(weights @ np.cos(doubled))
    along = (0.5 * math.atan2(s, c)) % math.pi
    forward = np.cos(L_r.directions[k] - along) > 0.0
    steps = np.where(forward, 1.0, -1.0) * (L_r.offsets[k] - turned.offsets[m])
    across = float(weights @ steps) / total
    spread = math.sqrt(float(weights @ (steps - across) ** 2) / total)
    return Translation(-math.sin(along) * across, math.cos(along) * across, 0, spread, along)
