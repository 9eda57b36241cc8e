"""What a component would come to: begun and solved apart from the graph that it may enter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.geometry import Pose
from lineloom_core.graph.bayes_tree import UnsettledError
from lineloom_core.graph.epoch import Epoch
from lineloom_core.graph.growth import Growth
from lineloom_core.graph.pose_table import PoseTable
from lineloom_core.graph.solver import settle


@dataclass(frozen=True, eq=False)
class Trial:
    """ids: (n,) nodes, ascending. rows: (n, 3) their poses. epoch: the tree, to go on from."""

    epoch: Epoch
    ids: NDArray[np.int64]
    rows: NDArray[np.float64]

    @classmethod
    def of(cls, held: int, start: Growth) -> Trial:
        """Solve a component whose smallest node is held."""
        epoch = Epoch(held, start)
        try:
            return cls(epoch, *epoch.estimates())
        except UnsettledError:
            return cls.from_optimum(held, start)

    @classmethod
    def from_optimum(cls, held: int, start: Growth) -> Trial:
        """The same, with damping first: for poses that are far off. Raises UnsettledError."""
        order = np.argsort(start.ids, kind="stable")
        rows, _ = settle(start, held)
        epoch = Epoch(held, replace(start, ids=start.ids[order], poses=rows))
        return cls(epoch, *epoch.estimates())

    @property
    def poses(self) -> Mapping[int, Pose]:
        """Poses by node."""
        return PoseTable({node: row for row, node in enumerate(self.ids.tolist())}, self.rows)
