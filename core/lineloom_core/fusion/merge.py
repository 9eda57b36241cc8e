"""Which observations are one wall: merging by summed moments, longest first."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.fusion import _kernels as kernels
from lineloom_core.fusion.segment_map import LineObservations
from lineloom_core.parameters import parameter

_LEAST_SIGMA_M = 1e-3  # no lidar line is better known than that; keeps weights comparable
_MAX_ROUNDS = 8


@storable("fusion-config")
@dataclass(frozen=True, slots=True)
class FusionConfig:
    """When two segments are one wall, and which walls are kept."""

    max_angle: float = parameter(
        math.radians(6.0),
        "rad",
        "between directions; they are oriented, so a thin wall's faces stay two",
    )
    max_offset: float = parameter(0.08, "m", "across, where they overlap")
    max_gap: float = parameter(0.15, "m", "along")
    max_spread: float = parameter(
        0.05, "m", "rms distance of a wall's mass from its line; keeps a curve's chords apart"
    )
    min_length: float = parameter(0.2, "m", "shorter walls are dropped")
    min_support: int = parameter(1, "keyframes", "walls that fewer saw are dropped", 1)
    min_length_alone: float = parameter(0.2, "m", "shorter walls that one keyframe saw are dropped")
    end_slack: float = parameter(
        0.3, "m", "by which one of at least four observations overshoots to no effect"
    )


def merge_observations(
    observations: LineObservations, config: FusionConfig
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the wall of each observation (n,) and the walls' moments and ends (m, 10).

    Observations are taken longest first (ties: oldest first), so that lines grow from what is
    known best, and what comes out does not depend on the order of the input. Walls that have grown
    together are merged in further rounds by the same rule, until nothing changes. Columns as in
    `_kernels`. Observations without length get -1.
    """
    labels = np.full(len(observations), -1, dtype=np.int64)
    lengths = _lengths(observations.endpoints)
    solid = np.flatnonzero(lengths > 1e-6)
    lines = as_pieces(
        observations.endpoints[solid], observations.sigma[solid], observations.weight[solid]
    )
    age = observations.id[solid]
    inner = np.arange(solid.size)
    for _ in range(_MAX_ROUNDS):
        before = lines.shape[0]
        order = np.lexsort((age, -_lengths(lines[:, kernels.X1 : kernels.Y2 + 1])))
        step, lines = kernels.merge_pass(
            lines,
            order,
            math.cos(config.max_angle),
            config.max_offset,
            config.max_gap,
            config.max_spread,
        )
        inner = step[inner]
        age = oldest(step, age, lines.shape[0])
        if lines.shape[0] == before:
            break
    labels[solid] = inner
    return labels, lines


def as_pieces(
    endpoints: NDArray[np.float64], sigma: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return segments as moments (n, 10): mass weight / sigma^2 spread evenly along each."""
    delta = endpoints[:, 2:] - endpoints[:, :2]
    mass = weight / np.maximum(sigma, _LEAST_SIGMA_M) ** 2
    pieces = np.empty((endpoints.shape[0], kernels.COLUMNS))
    pieces[:, kernels.W] = mass
    pieces[:, kernels.CX : kernels.CY + 1] = 0.5 * (endpoints[:, :2] + endpoints[:, 2:])
    pieces[:, kernels.SXX] = mass * delta[:, 0] ** 2 / 12.0
    pieces[:, kernels.SXY] = mass * delta[:, 0] * delta[:, 1] / 12.0
    pieces[:, kernels.SYY] = mass * delta[:, 1] ** 2 / 12.0
    pieces[:, kernels.X1 : kernels.Y2 + 1] = endpoints
    return pieces


def oldest(labels: NDArray[np.int64], age: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the least age (id) in each of `count` groups, shape (count,)."""
    least = np.full(count, np.iinfo(np.int64).max, dtype=np.int64)
    np.minimum.at(least, labels, age)
    return least


def _lengths(endpoints: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.hypot(
        endpoints[:, 2] - endpoints[:, 0], endpoints[:, 3] - endpoints[:, 1]
    )
    return lengths
