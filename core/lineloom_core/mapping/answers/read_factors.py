"""What gtsam holds of a site: read back from its own factors, and not from our records."""

from __future__ import annotations

import numpy as np

from lineloom_core.graph import read_back
from lineloom_core.mapping.answers.factor_graph import FactorGraph
from lineloom_core.mapping.belief.site_map import SiteMap


def read_factors(settled: SiteMap, version: int) -> FactorGraph:
    """Read a settled site's factors from gtsam."""
    ids, poses = settled.graph.estimates()
    read = [read_back(graph) for graph in settled.graph.solved]
    ends, measured, information = (
        np.concatenate([part[i] for part in read]) if read else np.empty(shape)
        for i, shape in enumerate([(0, 2), (0, 3), (0, 3, 3)])
    )
    row_of = {node: row for row, node in enumerate(ids.tolist())}
    rows = [row_of[node] for node in ends.ravel().tolist()]
    return FactorGraph(
        version=version,
        keyframes=tuple(settled.keyframes[k].name for k in ids.tolist()),
        components=tuple(settled.component_id(k) for k in ids.tolist()),
        poses=poses,
        ends=np.array(rows, np.int64).reshape(-1, 2),
        measured=measured,
        information=information,
    )
