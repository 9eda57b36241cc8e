"""How one component's Bayes trees came to be since they were begun: what a snapshot holds of them.

An ISAM2's last bits depend on its past, and it cannot be stored. So a component's trees are begun
anew at fixed points of the log, from all of its edges and the poses of that moment, and what came
since is kept: going through that again gives the same trees, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable
from lineloom_core.graph.bayes_tree import BayesTree, Purpose
from lineloom_core.graph.growth import Growth

_MOST_GROWTHS = 32
"""An epoch's length. Beginning anew costs some twenty, restoring a snapshot up to all of them."""


@storable("graph-epoch", held=int, growths=list[Growth])
class Epoch:
    """Trees for poses and for drift, made when they are first asked for.

    numbers: of the edges that are in it, by name. nodes: those in it.
    """

    def __init__(self, held: int, start: Growth) -> None:
        self._begin(held, [start])

    def _begin(self, held: int, growths: list[Growth]) -> None:
        self.held, self.growths = held, growths
        self.numbers: dict[str, int] = {}
        self.nodes: set[int] = set()
        self._entered = 0
        self._trees: dict[Purpose, tuple[BayesTree, int]] = {}
        for growth in growths:
            self._count(growth)

    def __getstate__(self) -> dict[str, Any]:
        return {"held": self.held, "growths": self.growths}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._begin(state["held"], state["growths"])

    @property
    def is_over(self) -> bool:
        """Whether it is time to begin anew."""
        return len(self.growths) >= _MOST_GROWTHS

    def grow(self, growth: Growth) -> None:
        """Take what came since."""
        self.growths.append(growth)
        self._count(growth)

    def _count(self, growth: Growth) -> None:
        gone = frozenset(growth.removed.tolist())
        if gone:
            self.numbers = {name: k for name, k in self.numbers.items() if k not in gone}
        self.numbers.update(zip(growth.names, range(self._entered, 10**12), strict=False))
        self._entered += len(growth.names)
        self.nodes.update(growth.ids.tolist())
        self.nodes.difference_update(growth.gone.tolist())

    def estimates(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return its nodes (n,), ascending, and their poses (n, 3).

        Raises UnsettledError.
        """
        tree = self._tree("poses")
        return tree.ids, tree.poses

    def drift(self, nodes: Sequence[int]) -> NDArray[np.float64]:
        """Return the covariances among some nodes by `drift_information`, (n, n, 3, 3)."""
        return self._tree("drift").relative_covariances(nodes)

    def _tree(self, purpose: Purpose) -> BayesTree:
        """The tree, with all that has grown by now: one growth after the other, as they came."""
        tree, taken = self._trees.get(purpose, (None, 0))
        if tree is None:
            tree, taken = BayesTree(purpose, self.held, self.growths[0]), 1
        for growth in self.growths[taken:]:
            tree.grow(growth)
        self._trees[purpose] = tree, len(self.growths)
        return tree
