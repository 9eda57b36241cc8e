"""Parameters as data: beside its default each has a unit, a meaning, and the values that can be."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

T = TypeVar("T")
Number = TypeVar("Number", int, float)
Word = TypeVar("Word", bound=str)

_BOUNDS = {"share": (0.0, 1.0), "rad": (0.0, math.pi), "m": (0.0, 1000.0), "s": (0.0, 86_400.0)}


class ParameterError(ValueError):
    """Parameters that are unknown or cannot be so. wrong: why not, by dotted name."""

    def __init__(self, wrong: Mapping[str, str]) -> None:
        said = (f"{name}: {reason}" if name else reason for name, reason in wrong.items())
        super().__init__("; ".join(said))
        self.wrong = wrong


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter. unit: "" for a plain number; "share" is 0 to 1. least, most: what it can be.

    whole: it counts something.
    """

    value: float
    default: float
    unit: str
    meaning: str
    least: float
    most: float
    whole: bool

    def checked(self, name: str, value: object) -> float:
        """Return a value for it. Raises ParameterError."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError({name: f"has to be a number, not {value!r}"})
        if not self.least <= value <= self.most:  # nor is NaN
            allowed = f"from {self.least:g} to {self.most:g} {self.unit}".rstrip()
            raise ParameterError({name: f"has to be {allowed}, not {value:g}"})
        if self.whole and value != int(value):
            raise ParameterError({name: f"has to be a whole number, not {value:g}"})
        return int(value) if self.whole else float(value)


@dataclass(frozen=True, slots=True)
class Choice:
    """A parameter that is one of a few words."""

    value: str
    default: str
    meaning: str
    choices: tuple[str, ...]

    def checked(self, name: str, value: object) -> str:
        """Return a value for it. Raises ParameterError."""
        if not isinstance(value, str) or value not in self.choices:
            raise ParameterError({name: f"has to be {' or '.join(self.choices)}, not {value!r}"})
        return value


def parameter(
    default: Number, unit: str, meaning: str, least: float | None = None, most: float | None = None
) -> Number:
    """Return the field of a parameters' dataclass; bounds that are not given are the unit's."""
    low, high = _BOUNDS.get(unit, (0.0, 1e9))
    described = (unit, meaning, low if least is None else least, high if most is None else most)
    made: Any = field(default=default, metadata={"parameter": described})
    return made  # type: ignore[no-any-return]


def choice(default: Word, meaning: str, choices: tuple[Word, ...]) -> Word:
    """Return the field of a parameters' dataclass that holds one of these words."""
    made: Any = field(default=default, metadata={"choice": (meaning, choices)})
    return made  # type: ignore[no-any-return]


def effective(config: Any) -> dict[str, Any]:
    """Return every parameter of a tree of dataclasses by name, nested as they are."""
    return _described(config, type(config)())


def _described(config: Any, default: Any) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for f in fields(config):
        value, usual = getattr(config, f.name), getattr(default, f.name)
        if is_dataclass(value):
            found[f.name] = _described(value, usual)
        elif "choice" in f.metadata:
            found[f.name] = Choice(value, usual, *f.metadata["choice"])
        else:
            unit, meaning, least, most = f.metadata["parameter"]
            whole = isinstance(usual, int)
            found[f.name] = Parameter(value, usual, unit, meaning, least, most, whole)
    return found


def values(config: Any) -> dict[str, Any]:
    """Return the values alone, nested; `with_values` makes the same config of them."""
    return {
        f.name: values(value) if is_dataclass(value := getattr(config, f.name)) else value
        for f in fields(config)
    }


def with_values(config: T, changes: Mapping[str, Any]) -> tuple[T, dict[str, str]]:
    """Return the config with these values, nested, in place of its own, and what is wrong.

    What is unknown or cannot be so is left out of the config, and told with the reason by its
    dotted name.
    """
    wrong: dict[str, str] = {}
    changed: T = _changed(config, effective(config), changes, "", wrong)
    return changed, wrong


def _changed(
    config: Any, known: dict[str, Any], changes: Any, above: str, wrong: dict[str, str]
) -> Any:
    if not isinstance(changes, Mapping):
        wrong[above] = f"has to hold parameters by name, not {changes!r}"
        return config
    new: dict[str, Any] = {}
    for key, value in changes.items():
        name = f"{above}.{key}" if above else str(key)
        if key not in known:
            wrong[name] = "is not a parameter"
        elif isinstance(known[key], Parameter | Choice):
            with _noting(wrong):
                new[key] = known[key].checked(name, value)
        else:
            new[key] = _changed(getattr(config, key), known[key], value, name, wrong)
    return replace(config, **new)


@contextmanager
def _noting(wrong: dict[str, str]) -> Iterator[None]:
    try:
        yield
    except ParameterError as error:
        wrong.update(error.wrong)


def by_name(tree: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Go through a nested mapping's leaves with their dotted names."""
    for key, value in tree.items():
        name = f"{above}.{key}" if above else key
        if isinstance(value, Mapping):
            yield from by_name(value, name)
        else:
            yield name, value
