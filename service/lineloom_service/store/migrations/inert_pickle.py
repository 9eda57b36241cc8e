"""What a pickle says, read without doing it: no class is looked up, nothing is called or imported.

Former versions left snapshots as pickles. Reading one by the interpreter's own means runs whatever
whoever wrote it wants; here every object is but a record of what would have been called.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

_VALUES = {
    *("BININT", "BININT1", "BININT2", "LONG1", "LONG4", "BINFLOAT"),
    *("SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"),
    *("SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8"),
}
_CONSTANTS: dict[str, Callable[[], Any]] = {
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_TUPLE": tuple,
    "EMPTY_LIST": list,
    "EMPTY_DICT": dict,
    "EMPTY_SET": list,
}
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}


@dataclass(eq=False, slots=True)
class Made:
    """An object that was not made. by: dotted name of the class or function that would make it.

    arguments: for that. state: what it would be given then, None where nothing. items: what it
    would be filled with.
    """

    by: str
    arguments: Any = ()
    state: Any = None
    items: list[Any] = field(default_factory=list)


def read_inert(data: bytes) -> Any:
    """Return what a pickle says: plain values, lists, dicts and tuples, and `Made` for all else.

    Raises ValueError for what is no pickle, or says it in a way that snapshots never did.
    """
    machine = _Machine()
    try:
        for opcode, argument, _ in pickletools.genops(data):
            if opcode.name == "STOP":
                return machine.stack.pop()
            machine.take(opcode.name, argument)
    except (IndexError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no pickle of a snapshot: {error!r}") from error
    raise ValueError("a pickle that does not end")


class _Machine:
    """A method for each word that changes what lies on the stack; `take` does the others."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self._marks: list[int] = []
        self._memo: list[Any] = []

    def take(self, name: str, argument: Any) -> None:
        if name in _VALUES:
            self.stack.append(argument)
        elif name in _CONSTANTS:
            self.stack.append(_CONSTANTS[name]())
        elif name in _TUPLES:
            self.stack.append(tuple(self._last(_TUPLES[name])))
        elif name in ("BINGET", "LONG_BINGET"):
            self.stack.append(self._memo[argument])
        elif name not in ("PROTO", "FRAME"):
            step: Callable[[], None] | None = getattr(self, f"on_{name.lower()}", None)
            if step is None:
                raise ValueError(f"no pickle of a snapshot: it says {name}")
            step()

    def _last(self, count: int) -> list[Any]:
        begin = len(self.stack) - count
        taken = self.stack[begin:]
        del self.stack[begin:]
        return taken

    def _marked(self) -> list[Any]:
        return self._last(len(self.stack) - self._marks.pop())

    def on_mark(self) -> None:
        self._marks.append(len(self.stack))

    def on_memoize(self) -> None:
        self._memo.append(self.stack[-1])

    def on_stack_global(self) -> None:
        self.stack.append(".".join(self._last(2)))

    def on_reduce(self) -> None:
        self.stack.append(Made(*self._last(2)))

    on_newobj = on_reduce

    def on_binpersid(self) -> None:
        self.stack.append(Made("persistent", self.stack.pop()))

    def on_build(self) -> None:
        state = self.stack.pop()
        self.stack[-1].state = state

    def on_tuple(self) -> None:
        self.stack.append(tuple(self._marked()))

    def on_frozenset(self) -> None:
        self.stack.append(Made("frozenset", tuple(self._marked())))

    def on_append(self) -> None:
        self._extend(self._last(1))

    def on_appends(self) -> None:
        self._extend(self._marked())

    on_additems = on_appends

    def on_setitem(self) -> None:
        self._update(self._last(2))

    def on_setitems(self) -> None:
        self._update(self._marked())

    def _extend(self, items: list[Any]) -> None:
        target = self.stack[-1]
        (target.items if isinstance(target, Made) else target).extend(items)

    def _update(self, flat: list[Any]) -> None:
        pairs = list(zip(flat[::2], flat[1::2], strict=True))
        target = self.stack[-1]
        if isinstance(target, Made):
            target.items.extend(pairs)
        else:
            target.update(pairs)
