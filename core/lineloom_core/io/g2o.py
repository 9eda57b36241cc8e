"""The pose graph in g2o's text format."""

from __future__ import annotations

import numpy as np

from lineloom_core.mapping.answers.site_view import ConstraintView, KeyframeView, SiteView


def write_graph(view: SiteView) -> str:
    """Return keyframes and accepted constraints as VERTEX_SE2, EDGE_SE2 and FIX lines.

    Full precision (17 digits where needed; gtsam's own writer keeps 6). Information is the upper
    triangle, row by row, in the axes of the second node, order x, y, theta. The oldest keyframe of
    each component is fixed: components are unrelated and each needs its own gauge. Candidates,
    rejected and retracted constraints are no part of the graph.
    """
    keyframes = sorted(view.keyframes, key=lambda k: k.id)
    rows = [_vertex(keyframe) for keyframe in keyframes]
    anchors: dict[str, int] = {}
    for keyframe in keyframes:
        anchors.setdefault(keyframe.component, keyframe.id)
    rows += [_edge(c) for c in view.constraints if c.state == "accepted"]
    # Last: gtsam's reader stops at the first tag that it does not know.
    rows += [f"FIX {anchor}" for anchor in anchors.values()]
    return "".join(row + "\n" for row in rows)


def _vertex(keyframe: KeyframeView) -> str:
    pose = keyframe.pose
    return f"VERTEX_SE2 {keyframe.id} {pose.x!r} {pose.y!r} {pose.theta!r}"


def _edge(constraint: ConstraintView) -> str:
    T = constraint.T_a_b
    upper = constraint.information[np.triu_indices(3)].tolist()
    figures = " ".join(repr(value) for value in (T.x, T.y, T.theta, *upper))
    return f"EDGE_SE2 {constraint.keyframe_a} {constraint.keyframe_b} {figures}"
