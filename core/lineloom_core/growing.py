"""An array that rows are appended to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from lineloom_core.codec import storable

_Scalar = TypeVar("_Scalar", bound=np.generic)


@storable("growing-array", rows=NDArray[Any])
class GrowingArray(Generic[_Scalar]):
    """Rows of one shape, at the price of a list: room is doubled when it runs out."""

    def __init__(self, dtype: type[_Scalar], shape: tuple[int, ...] = ()) -> None:
        self._room: NDArray[_Scalar] = np.empty((16, *shape), dtype=dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Any) -> None:
        """Add one row."""
        if self._count == len(self._room):
            more = np.empty((max(16, self._count), *self._room.shape[1:]), self._room.dtype)
            self._room = np.concatenate([self._room, more])
        self._room[self._count] = row
        self._count += 1

    def keep(self, chosen: Sequence[bool]) -> None:
        """Keep only the rows that are chosen, in their order."""
        self._room = self.rows[np.asarray(chosen, dtype=np.bool_)]
        self._count = len(self._room)

    @property
    def rows(self) -> NDArray[_Scalar]:
        """All rows, to be read and written; valid until the next is appended."""
        return self._room[: self._count]

    def __getstate__(self) -> dict[str, Any]:
        return {"rows": self.rows}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._room, self._count = state["rows"], len(state["rows"])
