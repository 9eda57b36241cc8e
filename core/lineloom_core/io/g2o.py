"""The pose graph in g2o's text format."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.mapping.answers.factor_graph import FactorGraph

_UPPER = np.triu_indices(3)


def write_graph(graph: FactorGraph, frames: Mapping[str, Pose] | None = None) -> str:
    """Return gtsam's values and factors as VERTEX_SE2, EDGE_SE2 and FIX lines.

    frames: by component T_shown_map, of those that are to be written; None: all as they are.

    Full precision (17 digits where needed; gtsam's own writer keeps 6, and refuses robust
    factors). Information is the upper triangle, row by row, in the axes of the second node, order
    x, y, theta. The oldest keyframe of each component is fixed: components are unrelated and each
    needs its own gauge. Vertices are numbered by row, for g2o knows no other names.
    """
    shown = [frames is None or c in frames for c in graph.components]
    anchors: dict[str, int] = {}
    rows: list[str] = []
    for i, (component, pose) in enumerate(zip(graph.components, graph.poses, strict=True)):
        if shown[i]:
            anchors.setdefault(component, i)
            rows.append(f"VERTEX_SE2 {i} {_figures(_moved(pose, component, frames))}")
    for (a, b), T, I in zip(graph.ends.tolist(), graph.measured, graph.information, strict=True):  # noqa: E741
        if shown[a]:
            rows.append(f"EDGE_SE2 {a} {b} {_figures(T)} {_figures(I[_UPPER])}")
    # Last: gtsam's reader stops at the first tag that it does not know.
    rows += [f"FIX {anchor}" for anchor in anchors.values()]
    return "".join(row + "\n" for row in rows)


def _moved(
    pose: NDArray[np.float64], component: str, frames: Mapping[str, Pose] | None
) -> NDArray[np.float64]:
    return pose if frames is None else (frames[component] @ Pose.from_array(pose)).to_array()


def _figures(values: NDArray[np.float64]) -> str:
    return " ".join(map(repr, values.tolist()))
