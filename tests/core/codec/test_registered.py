"""What the core registers: every field says what it holds, so that it can be checked."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import textwrap
from dataclasses import is_dataclass

import lineloom_core
from lineloom_core.codec.registry import BY_NAME

ANYTHING: set[str] = set()
"""Fields that may hold whatever is storable."""

MADE_ANEW = {
    "memory.sealed",
    "memory.places",
    "memory.index",
    "memory._hypotheses",
    "memory._look_alikes",
    "recent.map",
    "recent.steady",
}
"""Attributes that the class's `__setstate__` makes of the others."""


def registered() -> dict[str, type]:
    for module in pkgutil.walk_packages(lineloom_core.__path__, "lineloom_core."):
        importlib.import_module(module.name)
    return {n: e.cls for n, e in BY_NAME.items() if e.cls.__module__.startswith("lineloom_core.")}


def test_every_field_says_what_it_holds() -> None:
    classes = registered()
    assert len(classes) > 40
    loose = {
        f"{name}.{field}"
        for name in classes
        for field, check in BY_NAME[name].checks.items()
        if not check.options
    }
    assert loose == ANYTHING


def attributes(source: str) -> set[str]:
    """The attributes that a class's methods set on themselves."""
    return {
        node.attr
        for node in ast.walk(ast.parse(textwrap.dedent(source)))
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and ast.unparse(node.value) == "self"
    }


def test_every_attribute_of_a_stored_object_is_declared() -> None:
    """One that is forgotten would be missing in a mapper that goes on from a snapshot."""
    plain = {
        name: cls
        for name, cls in registered().items()
        if not is_dataclass(cls) and "__getstate__" not in cls.__dict__  # that is compared anyway
    }
    assert len(plain) > 5
    forgotten = {
        f"{name}.{attribute}"
        for name, cls in plain.items()
        for attribute in attributes(inspect.getsource(cls)) - set(BY_NAME[name].names)
    }
    assert forgotten == MADE_ANEW


def test_the_search_finds_a_forgotten_attribute() -> None:
    text = "class A:\n    def f(self, o):\n        self.a = o.b = 1\n        self.c: int = self.d\n"
    assert attributes(text) == {"a", "c"}
