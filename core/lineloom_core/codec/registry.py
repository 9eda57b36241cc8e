"""Which classes may be stored, under which names, with which fields: a closed list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any, TypeVar, get_type_hints

from lineloom_core.codec.checking import Check, check_of
from lineloom_core.codec.errors import CodecError

_T = TypeVar("_T")


class Entry:
    """A registered class. names: of its fields, as they are written by this code."""

    def __init__(self, name: str, cls: type, types: dict[str, Any] | None, *, shared: bool) -> None:
        self.name, self.cls, self.shared = name, cls, shared
        self._types = types
        self.names = tuple(f.name for f in fields(cls)) if types is None else tuple(types)
        if types is None and not all(f.init and not f.kw_only for f in fields(cls)):
            raise TypeError(f"{name}: every field must be a plain argument")
        own = types is not None and "__getstate__" in cls.__dict__
        self.values = self._from_state if own else _getter(self.names)
        self._restores = types is not None and "__setstate__" in cls.__dict__

    def _from_state(self, obj: Any) -> tuple[Any, ...]:
        state = obj.__getstate__()
        if state.keys() != set(self.names):
            raise CodecError(f"{self.name}: its state is not of the declared attributes")
        return tuple(state[name] for name in self.names)

    @cached_property
    def checks(self) -> dict[str, Check]:
        """By field, what its values must be. Made late: annotations name what comes later."""
        types = get_type_hints(self.cls) if self._types is None else self._types
        return {name: check_of(types[name]) for name in self.names}

    def maker(self, names: tuple[str, ...]) -> Callable[..., Any]:
        """Return what makes an object of the values of all fields, in the order of these names."""
        if self._types is None:
            cls: Callable[..., Any] = self.cls
            if names == self.names:
                return cls
            return lambda *values: cls(**dict(zip(names, values, strict=True)))
        return lambda *values: self._restored(dict(zip(names, values, strict=True)))

    def _restored(self, state: dict[str, Any]) -> Any:
        obj: Any = object.__new__(self.cls)
        if self._restores:
            obj.__setstate__(state)
        else:
            obj.__dict__.update(state)
        return obj


BY_CLASS: dict[type, Entry] = {}
BY_NAME: dict[str, Entry] = {}


def storable(name: str, *, shared: bool = False, **types: Any) -> Callable[[type[_T]], type[_T]]:
    """Let a class be stored under a name, which must never change nor be used for another one.

    Of a dataclass all fields are written. Of another class those attributes that are named here
    with their types, as its own `__getstate__` and `__setstate__` have them if there are any.
    shared: one object in several places of a message is one object again, as arrays always are.
    Raises TypeError for a name or a class that is taken.
    """

    def register(cls: type[_T]) -> type[_T]:
        entry = Entry(name, cls, None if is_dataclass(cls) else types, shared=shared)
        if name in BY_NAME or cls in BY_CLASS or (types and is_dataclass(cls)):
            raise TypeError(f"{name}: registered already, or attributes of a dataclass")
        BY_NAME[name] = BY_CLASS[cls] = entry
        return cls

    return register


def _getter(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    if len(names) > 1:
        return attrgetter(*names)
    return lambda obj: tuple(getattr(obj, name) for name in names)
