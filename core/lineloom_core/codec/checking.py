"""What a field's annotation lets its values be, as a check that is quick where all is well.

Types of many elements are looked at together, each type once. What an annotation does not tell, as
the shape of an array, is not checked here.
"""

from __future__ import annotations

import types
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

import numpy as np

_BASIC: dict[Any, tuple[type, ...]] = {
    None: (type(None),),
    bool: (bool, np.bool_),
    int: (int, np.integer),
    float: (float, int, np.floating, np.integer),
    Mapping: (Mapping,),
    Sequence: (list, tuple),
    Collection: (list, tuple, set, frozenset, dict),
}
_OF_ONE_KIND = (list, set, frozenset, deque, Sequence, Collection)


@dataclass(frozen=True, slots=True)
class _Option:
    """One of the kinds of value that are allowed. fits: what its type does not tell."""

    classes: tuple[type, ...]
    fits: Callable[[Any], bool] | None = None

    def takes(self, kind: type) -> bool:
        return issubclass(kind, self.classes) and (kind is not bool or bool in self.classes)


@dataclass(frozen=True, slots=True)
class Check:
    """What values may be; anything where there are no options."""

    options: tuple[_Option, ...] = ()

    @property
    def is_deep(self) -> bool:
        """Whether there is more to look at than the type."""
        return any(option.fits is not None for option in self.options)

    def takes(self, kind: type) -> bool:
        """Whether values of a type may be right."""
        return not self.options or any(option.takes(kind) for option in self.options)

    def fits(self, value: Any) -> bool:
        """Whether a value is right."""
        kind = type(value)
        return not self.options or any(
            option.takes(kind) and (option.fits is None or option.fits(value))
            for option in self.options
        )

    def fits_all(self, values: Collection[Any]) -> bool:
        """Whether all of these are right."""
        if not self.options:
            return True
        if not all(map(self.takes, set(map(type, values)))):
            return False
        return not self.is_deep or all(map(self.fits, values))


def check_of(annotation: Any) -> Check:
    """Return the check of an annotation. Raises TypeError for one that no value can be held to."""
    if annotation in (Any, object) or isinstance(annotation, TypeVar):
        return Check()
    origin, args = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        checks = [check_of(arg) for arg in args]
        if not all(check.options for check in checks):
            return Check()
        return Check(tuple(option for check in checks for option in check.options))
    if origin is Literal:
        return Check((_Option(tuple({type(a) for a in args}), lambda value: value in args),))
    kind = annotation if origin is None else origin
    classes = _BASIC.get(kind) or (kind,)
    if not all(isinstance(cls, type) for cls in classes) or getattr(kind, "_is_protocol", False):
        raise TypeError(f"no value can be held to {annotation!r}")
    return Check((_Option(classes, _inside(kind, args)),))


def _inside(kind: Any, args: tuple[Any, ...]) -> Callable[[Any], bool] | None:
    """What the elements must be; None where nothing is said of them."""
    if kind is np.ndarray:
        said = get_args(args[-1]) if args else ()
        scalars = tuple(s for s in said if isinstance(s, type) and s is not Any)
        return (lambda array: issubclass(array.dtype.type, scalars)) if scalars else None
    if kind is tuple and args and args[-1] is not Ellipsis:
        return partial(_fits_each, [check_of(arg) for arg in args])
    if kind in (dict, Mapping) and args:
        return partial(_fits_items, check_of(args[0]), check_of(args[1]))
    if (kind is tuple or kind in _OF_ONE_KIND) and args and check_of(args[0]).options:
        return check_of(args[0]).fits_all
    return None


def _fits_each(checks: Sequence[Check], values: tuple[Any, ...]) -> bool:
    return len(values) == len(checks) and all(
        check.fits(value) for check, value in zip(checks, values, strict=True)
    )


def _fits_items(keys: Check, values: Check, mapping: Mapping[Any, Any]) -> bool:
    """Of a mapping that is an object of its own, its own fields have been checked."""
    if not isinstance(mapping, dict):
        return True
    return keys.fits_all(mapping.keys()) and values.fits_all(mapping.values())
