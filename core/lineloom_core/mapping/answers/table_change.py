"""What changed in a table: entries by id, in an order."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from itertools import compress
from operator import attrgetter, is_not
from typing import Any, Generic, TypeVar

import msgpack
import numpy as np

from lineloom_core.codec import storable

Id = TypeVar("Id", bound=Hashable)
Entry = TypeVar("Entry")
Other = TypeVar("Other")


@storable("table-change")
@dataclass(frozen=True, slots=True)
class TableChange(Generic[Id, Entry]):
    """The difference of two tables.

    new: entries that are new or not what they were, as they are now. gone: ids of those that are
    no longer there. order: of all ids, where it is not that of before with what came at the end.
    """

    new: Mapping[Id, Entry] = field(default_factory=dict)
    gone: tuple[Id, ...] = ()
    order: tuple[Id, ...] | None = None

    def __bool__(self) -> bool:
        return bool(self.new or self.gone or self.order is not None)

    @classmethod
    def between(
        cls, before: Mapping[Id, Entry], after: Mapping[Id, Entry], same: Same | None = None
    ) -> TableChange[Id, Entry]:
        """Compare two tables to the last bit; what is the same object in both at hardly any cost.

        same: of the caller, who compares several tables.
        """
        alike = same or Same()
        new = {
            id: entry
            for id, entry in after.items()
            if (was := before.get(id)) is not entry and (was is None or not alike(was, entry))
        }
        gone = tuple(id for id in before if id not in after)
        change = cls(new, gone)
        in_order = list(before) if not change else list(change.apply(before))
        return change if in_order == list(after) else cls(new, gone, tuple(after))

    def mapped(self, made_of: Callable[[Entry], Other]) -> TableChange[Id, Other]:
        """Return the change of a table of what is made of the entries."""
        new = {id: made_of(entry) for id, entry in self.new.items()}
        return TableChange(new, self.gone, self.order)

    def apply(self, before: Mapping[Id, Entry]) -> dict[Id, Entry]:
        """Return the table after; what did not change in it are the same objects.

        Raises KeyError where it is the change of another table.
        """
        gone = set(self.gone)
        after = {id: entry for id, entry in before.items() if id not in gone}
        after.update(self.new)
        return after if self.order is None else {id: after[id] for id in self.order}


class Same:
    """Tells whether two values are the same to the last bit, whatever compares equal. One thread's.

    Values are dataclasses, arrays and what is plain. A zero differs from a negative one, and what
    is not a number is the same as itself.
    """

    def __init__(self) -> None:
        self._bits: Callable[[object], bytes] = msgpack.Packer(default=_plain).pack

    def __call__(self, one: object, other: object) -> bool:
        if type(one) is not type(other):
            return False
        # Of a constraint hardly a field is another object in the next view: only that is looked at.
        mine, its = _fields(one), _fields(other)
        apart = tuple(map(is_not, mine, its))
        return self._bits([*compress(mine, apart)]) == self._bits([*compress(its, apart)])


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.dtype.str, value.shape, value.tobytes()
    return _fields(value)


def _fields(value: Any) -> tuple[Any, ...]:
    kind: Any = type(value)
    return _getter(kind)(value)


@cache
def _getter(kind: Any) -> Callable[[object], tuple[Any, ...]]:
    if not is_dataclass(kind):
        return lambda value: (value,)
    names = tuple(f.name for f in fields(kind))
    return attrgetter(*names) if len(names) > 1 else lambda value: (getattr(value, names[0]),)
