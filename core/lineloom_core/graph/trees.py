"""The Bayes trees of a graph's components, and what waits to enter and to leave them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lineloom_core.codec import storable
from lineloom_core.graph.epoch import Epoch
from lineloom_core.graph.growth import Growth


@storable(
    "graph-trees",
    epochs=dict[int, Epoch],
    waiting=dict[int, dict[str, None]],
    leaving=dict[int, list[int]],
    gone=dict[int, list[int]],
)
class Trees:
    """By component, which is named by its smallest node: that is the one held.

    waiting: names of edges that are in no tree. leaving: numbers of edges that are in the tree and
    not in the graph any more; gone: such nodes.
    """

    def __init__(self) -> None:
        self.epochs: dict[int, Epoch] = {}
        self.waiting: dict[int, dict[str, None]] = {}
        self.leaving: dict[int, list[int]] = {}
        self.gone: dict[int, list[int]] = {}

    def __getstate__(self) -> dict[str, Any]:
        return dict(self.__dict__)

    def enter(self, root: int, name: str) -> None:
        """An edge is new in the graph."""
        self.waiting.setdefault(root, {})[name] = None

    def leave(self, root: int, name: str) -> None:
        """An edge is in the graph no more."""
        if name in self.waiting.get(root, ()):
            del self.waiting[root][name]
        else:
            self.leaving.setdefault(root, []).append(self.epochs[root].numbers[name])

    def lose(self, root: int, node: int) -> None:
        """A node is in the graph no more, and none of its edges is."""
        if root in self.epochs and node in self.epochs[root].nodes:
            self.gone.setdefault(root, []).append(node)

    def join(self, root: int, other: int) -> None:
        """Two components have become one, named by the first."""
        if other in self.epochs:
            self.forget(root)
            self.forget(other)
        self.waiting.setdefault(root, {}).update(self.waiting.pop(other, {}))

    def forget(self, root: int) -> None:
        """Have a component's tree begun anew: all of its edges wait."""
        epoch = self.epochs.pop(root, None)
        left = frozenset(self.leaving.pop(root, ()))
        self.gone.pop(root, None)
        if epoch is not None:
            inside = {name: None for name, k in epoch.numbers.items() if k not in left}
            self.waiting[root] = inside | self.waiting.get(root, {})

    def split(self, roots: set[int], root_of: Callable[[str], int]) -> None:
        """Components have fallen apart; root_of: of an edge's component, as they are now."""
        for root in roots:
            self.forget(root)
            for name in self.waiting.pop(root, {}):
                self.enter(root_of(name), name)

    def take(self, root: int, growth: Growth) -> Epoch:
        """Let a component's tree take all that waited: its epoch, which goes on."""
        epoch = self.epochs[root]
        epoch.grow(growth)
        self._up_to_date(root)
        return epoch

    def begin(self, epoch: Epoch) -> None:
        """Begin anew, with all of a component."""
        self.epochs[epoch.held] = epoch
        self._up_to_date(epoch.held)

    def _up_to_date(self, root: int) -> None:
        for rows in (self.waiting, self.leaving, self.gone):
            rows.pop(root, None)
