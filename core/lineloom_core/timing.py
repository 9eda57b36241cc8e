"""How long stages of the mapping take, told to whoever asked. Nothing in a map depends on it."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

Listener = Callable[[str, float], None]
"""Given the name of a stage and the seconds that one run of it took."""

_listeners: list[Listener] = []


def listen(listener: Listener | None) -> None:
    """Have `listener` told of every run of a stage in this process, from now on; None: nobody."""
    _listeners[:] = [] if listener is None else [listener]


def timed(stage: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Mark a function as a stage. Costs a look at a list where nobody listens."""

    def mark(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @functools.wraps(function)
        def run(*args: _P.args, **kwargs: _P.kwargs) -> _R:
            if not _listeners:
                return function(*args, **kwargs)
            begin = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                seconds = time.perf_counter() - begin
                for listener in _listeners:
                    listener(stage, seconds)

        return run

    return mark
