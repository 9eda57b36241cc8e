"""What was made of an object, kept by the objects used last, or by as many as there is room for."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Generic, TypeVar
from weakref import ref

Owner = TypeVar("Owner")
Made = TypeVar("Made")


class UsedLately(Generic[Owner, Made]):
    """A function of one object, remembered by the object: it goes when that goes.

    `functools.lru_cache` would keep hundreds of objects alive that nobody else knows any more.
    most: objects that remember; of more the one longest unused forgets. Not thread safe.
    """

    def __init__(self, make: Callable[[Owner], Made], most: int) -> None:
        self._make = make
        self._most = most
        self._name = f"_{id(self)}"
        self._order: OrderedDict[int, ref[Any]] = OrderedDict()

    def __len__(self) -> int:
        return len(self._order)

    def __call__(self, owner: Owner) -> Made:
        """Return what is made of an object; it must have a `__dict__`."""
        key = id(owner)
        if key in self._order:
            self._order.move_to_end(key)
            made: Made = owner.__dict__[self._name]
            return made
        made = owner.__dict__[self._name] = self._make(owner)
        self._order[key] = ref(owner, lambda _: self._order.pop(key, None))
        if len(self._order) > self._most:
            _, oldest = self._order.popitem(last=False)
            del oldest().__dict__[self._name]
        return made


class KeptWithin(Generic[Owner, Made]):
    """A function of one object, remembered while there is room, and as long as the object is there.

    For who goes through all objects again and again: of what was used last all would be forgotten
    by the time it is wanted. size: of what is made [bytes]; most: of all together. Not thread safe.
    """

    def __init__(
        self, make: Callable[[Owner], Made], size: Callable[[Made], int], most: int
    ) -> None:
        self._make, self._size = make, size
        self._room = most
        self._kept: dict[int, tuple[ref[Any], Made]] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def __call__(self, owner: Owner) -> Made:
        """Return what is made of an object."""
        key = id(owner)
        if key in self._kept:
            return self._kept[key][1]
        made = self._make(owner)
        size = self._size(made)
        if size <= self._room:
            self._room -= size
            self._kept[key] = ref(owner, lambda _: self._forget(key, size)), made
        return made

    def _forget(self, key: int, size: int) -> None:
        del self._kept[key]
        self._room += size
