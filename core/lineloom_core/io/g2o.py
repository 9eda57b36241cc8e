"""The pose graph in g2o's text format."""

from __future__ import annotations

import numpy as np

from lineloom_core.mapping.answers.site_view import ConstraintView, KeyframeView, SiteView


def write_graph(view: SiteView) -> str:
    """Return keyframes and accepted constraints as VERTEX_SE2, EDGE_SE2 and FIX lines.

    Full precision (17 digits where needed; gtsam's own writer keeps 6). Information is the upper
    triangle, row by row, in the axes of the second node, order x, y, theta. The oldest keyframe of
    each component is fixed: components are unrelated and each needs its own gauge. Candidates,
    rejected and retracted constraints are no part of the graph. Vertices are numbered in the order
    of the view, for g2o knows no other names.
    """
    number = {keyframe.id: i for i, keyframe in enumerate(view.keyframes)}
    rows = [_vertex(i, keyframe) for i, keyframe in enumerate(view.keyframes)]
    anchors: dict[str, int] = {}
    for i, keyframe in enumerate(view.keyframes):
        anchors.setdefault(keyframe.component, i)
    rows += [_edge(c, number) for c in view.constraints if c.state == "accepted"]
    # Last: gtsam's reader stops at the first tag that it does not know.
    rows += [f"FIX {anchor}" for anchor in anchors.values()]
    return "".join(row + "\n" for row in rows)


def _vertex(number: int, keyframe: KeyframeView) -> str:
    pose = keyframe.pose
    return f"VERTEX_SE2 {number} {pose.x!r} {pose.y!r} {pose.theta!r}"


def _edge(constraint: ConstraintView, number: dict[str, int]) -> str:
    T = constraint.T_a_b
    upper = constraint.information[np.triu_indices(3)].tolist()
    figures = " ".join(repr(value) for value in (T.x, T.y, T.theta, *upper))
    a, b = number[constraint.keyframe_a], number[constraint.keyframe_b]
    return f"EDGE_SE2 {a} {b} {figures}"
