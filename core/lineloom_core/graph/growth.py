"""What one update brings to a component's Bayes tree, as arrays: made to be stored and replayed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.geometry import Pose, se2
from lineloom_core.graph.edge import Edge


def _none() -> NDArray[np.int64]:
    return np.zeros(0, dtype=np.int64)


@storable("graph-growth")
@dataclass(frozen=True, eq=False)
class Growth:
    """Nodes and edges that enter, and those that leave.

    ids: (n,) nodes that enter. poses: (n, 3), where they are taken to be [m, m, rad]. names: of
    the m edges that enter. ends: (m, 2) their nodes. measured: (m, 3) T_a_b. information:
    (m, 3, 3), by which poses are weighed; drift_information: (m, 3, 3), by which drift is judged;
    both in the tangent at b. robust: (m,). removed: edges that leave, by number, as they entered
    from 0 on. gone: nodes that leave with the last of their edges.
    """

    ids: NDArray[np.int64]
    poses: NDArray[np.float64]
    names: tuple[str, ...]
    ends: NDArray[np.int64]
    measured: NDArray[np.float64]
    information: NDArray[np.float64]
    drift_information: NDArray[np.float64]
    robust: NDArray[np.bool_]
    removed: NDArray[np.int64] = field(default_factory=_none)
    gone: NDArray[np.int64] = field(default_factory=_none)

    @classmethod
    def of(
        cls,
        ids: NDArray[np.int64],
        poses: NDArray[np.float64],
        edges: Sequence[Edge],
        removed: Sequence[int] = (),
        gone: Sequence[int] = (),
    ) -> Growth:
        """Build from edges as objects."""
        m = len(edges)
        return cls(
            ids=ids,
            poses=poses,
            names=tuple(e.id for e in edges),
            ends=np.array([(e.node_a, e.node_b) for e in edges], np.int64).reshape(m, 2),
            measured=np.array([e.T_a_b.to_array() for e in edges]).reshape(m, 3),
            information=np.array([e.information for e in edges]).reshape(m, 3, 3),
            drift_information=np.array([e.drift_information for e in edges]).reshape(m, 3, 3),
            robust=np.array([e.robust for e in edges], np.bool_),
            removed=np.array(removed, np.int64),
            gone=np.array(gone, np.int64),
        )

    def moved(self, T_new_old: Pose) -> Growth:
        """The same in another frame, its edges as they were."""
        return replace(self, poses=se2.compose(T_new_old.to_array(), self.poses))


def together(first: Growth, second: Growth, edges: Sequence[Edge]) -> Growth:
    """Two of them without a common node, in one frame, and edges between them."""
    parts = first, second, Growth.of(_none(), np.zeros((0, 3)), edges)
    names = tuple(name for part in parts for name in part.names)
    columns = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Growth)
        if field.name != "names"
    }
    return Growth(names=names, **columns)
