"""Connected sets of nodes, kept while edges are added (union-find)."""

from __future__ import annotations

from collections.abc import Iterable


class Components:
    """Disjoint sets of integers; each is named by its smallest member.

    Naming by the smallest member makes every answer independent of the order of insertion.
    """

    def __init__(self, nodes: Iterable[int] = (), links: Iterable[tuple[int, int]] = ()) -> None:
        self._parent: dict[int, int] = {}
        for node in nodes:
            self.add(node)
        for a, b in links:
            self.join(a, b)

    def add(self, node: int) -> None:
        """Add a node that is alone. Known nodes are left as they are."""
        self._parent.setdefault(node, node)

    def root(self, node: int) -> int:
        """Return the smallest member of the node's set. Raises KeyError for an unknown node."""
        parent = self._parent
        root = node
        while parent[root] != root:
            root = parent[root]
        while parent[node] != root:  # shorten the way for the next one who asks
            parent[node], node = root, parent[node]
        return root

    def join(self, a: int, b: int) -> bool:
        """Unite the sets of a and b; return whether they were two."""
        root_a, root_b = self.root(a), self.root(b)
        if root_a == root_b:
            return False
        self._parent[max(root_a, root_b)] = min(root_a, root_b)
        return True

    def sets(self) -> tuple[tuple[int, ...], ...]:
        """Return all sets, each sorted, ordered by their smallest members."""
        members: dict[int, list[int]] = {}
        for node in sorted(self._parent):
            members.setdefault(self.root(node), []).append(node)
        return tuple(tuple(nodes) for nodes in members.values())
