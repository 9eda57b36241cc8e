"""What the core registers: every field says what it holds, so that it can be checked."""

from __future__ import annotations

import importlib
import pkgutil

import lineloom_core
from lineloom_core.codec.registry import BY_NAME

ANYTHING: set[str] = set()
"""Fields that may hold whatever is storable."""


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
