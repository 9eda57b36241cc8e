"""The fused line map: many observations in, one line per wall out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lineloom_core.fusion import _kernels as kernels
from lineloom_core.fusion.merge import FusionConfig, merge_observations, oldest
from lineloom_core.fusion.segment_map import FusedLines, LineObservations

_TRIM_FROM_SUPPORT = 4


def fuse(observations: LineObservations, config: FusionConfig | None = None) -> FusedLines:
    """Return the walls that the observations show, ordered by id.

    Each wall is the total-least-squares line of all its observations, from the outermost to the
    outermost end (see `FusionConfig.end_slack`). Its sigma adds what the observations promise,
    1/sum(1/sigma^2), and how far they are in fact from each other over the number of keyframes:
    pose errors make the first alone a boast. The same observations give the same lines, bit for
    bit and in any order; moving all of them moves the lines.
    """
    config = config or FusionConfig()
    labels, lines = merge_observations(observations, config)
    solid = labels >= 0
    of, m = labels[solid], lines.shape[0]
    support = _distinct(of, observations.keyframe[solid], m)
    endpoints = _endpoints(observations.endpoints[solid], of, lines, support, config.end_slack)
    length = np.hypot(endpoints[:, 2] - endpoints[:, 0], endpoints[:, 3] - endpoints[:, 1])
    names = oldest(of, observations.id[solid], m)
    kept = (support >= config.min_support) & (length >= config.min_length)
    kept &= (support > 1) | (length >= config.min_length_alone)
    order = np.flatnonzero(kept)[np.argsort(names[kept], kind="stable")]
    first, last = np.full(m, np.inf), np.full(m, -np.inf)
    np.minimum.at(first, of, observations.stamp[solid])
    np.maximum.at(last, of, observations.stamp[solid])
    return FusedLines(
        endpoints=endpoints[order],
        sigma=_sigma(lines, support)[order],
        support=support[order],
        robots=_robots(of, observations.robot[solid], m, order),
        first_seen=first[order],
        last_seen=last[order],
        id=names[order],
        line_of=_renumbered(labels, order, m),
    )


def _endpoints(
    observed: NDArray[np.float64],
    labels: NDArray[np.int64],
    lines: NDArray[np.float64],
    support: NDArray[np.int64],
    end_slack: float,
) -> NDArray[np.float64]:
    """Return the end points (m, 4): the observations' extent on the fitted line.

    A slight overshoot of one observation is a mixed pixel or a corner cut short; a long one is a
    stretch of wall that nobody else had in view, and stays.
    """
    along = kernels.extents(np.ascontiguousarray(observed), labels, lines)
    low, high = along[:, 0].copy(), along[:, 2].copy()
    enough = support >= _TRIM_FROM_SUPPORT
    trim_low = enough & (along[:, 1] - low < end_slack)
    trim_high = enough & (high - along[:, 3] < end_slack)
    low[trim_low], high[trim_high] = along[trim_low, 1], along[trim_high, 3]
    u = lines[:, kernels.X2 : kernels.Y2 + 1] - lines[:, kernels.X1 : kernels.Y1 + 1]
    u = u / np.hypot(u[:, 0], u[:, 1])[:, None]
    centre = lines[:, kernels.CX : kernels.CY + 1]
    return np.hstack([centre + low[:, None] * u, centre + high[:, None] * u])


def _sigma(lines: NDArray[np.float64], support: NDArray[np.int64]) -> NDArray[np.float64]:
    sxx, sxy, syy = lines[:, kernels.SXX], lines[:, kernels.SXY], lines[:, kernels.SYY]
    least = 0.5 * (sxx + syy) - np.hypot(0.5 * (sxx - syy), sxy)
    variance = np.maximum(least, 0.0) / lines[:, kernels.W]
    sigma: NDArray[np.float64] = np.sqrt(1.0 / lines[:, kernels.W] + variance / support)
    return sigma


def _distinct(
    labels: NDArray[np.int64], values: NDArray[np.int64], count: int
) -> NDArray[np.int64]:
    """Return the number of distinct values in each of `count` groups."""
    pairs = np.unique(np.column_stack([labels, values]), axis=0)
    return np.bincount(pairs[:, 0], minlength=count).astype(np.int64)


def _robots(
    labels: NDArray[np.int64], robots: NDArray[np.int64], count: int, order: NDArray[np.int64]
) -> tuple[tuple[int, ...], ...]:
    pairs = np.unique(np.column_stack([labels, robots]), axis=0)
    starts = np.searchsorted(pairs[:, 0], np.arange(count + 1)).tolist()
    names = pairs[:, 1].tolist()
    return tuple(tuple(names[starts[line] : starts[line + 1]]) for line in order.tolist())


def _renumbered(
    labels: NDArray[np.int64], order: NDArray[np.int64], count: int
) -> NDArray[np.int64]:
    """Return the place of each observation's wall in `order`, -1 where it was dropped."""
    place = np.full(count + 1, -1, dtype=np.int64)
    place[order] = np.arange(order.size)
    renumbered: NDArray[np.int64] = place[labels]  # label -1 reads the last entry, -1 as well
    return renumbered
