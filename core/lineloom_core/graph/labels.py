"""Which nodes hang together."""

from __future__ import annotations

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components


def labels(ids: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for every node the smallest id that edges connect it with, shape (n,).

    ends: (m, 2), rows of the edges' nodes in `ids`.
    """
    if not len(ids):
        return np.zeros(0, dtype=np.int64)
    links = (np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1]))
    shape = (len(ids), len(ids))
    sets, member = connected_components(scipy.sparse.coo_matrix(links, shape=shape), directed=False)
    smallest = np.full(sets, np.iinfo(np.int64).max)
    np.minimum.at(smallest, member, ids)
    named: NDArray[np.int64] = smallest[member]
    return named
