"""A thread with a stack as deep as gtsam's recursion.

gtsam walks its elimination tree recursively, and the tree of a chain without a loop is as deep as
the chain is long: 30,000 nodes overflow the usual 8 MB. 100,000 pass with 512 MB, of which only
what is used becomes memory.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_T = TypeVar("_T")

_STACK_BYTES = 512 << 20
_SHALLOW = 4000
"""Nodes up to which any thread's stack does: a quarter of what overflows 8 MB, and 1 MB holds."""

_inside = threading.local()


def with_depth(nodes: int, call: Callable[[], _T]) -> _T:
    """Return what the call does, on a stack that is deep enough for a tree of so many nodes."""
    if nodes <= _SHALLOW or getattr(_inside, "deep", False):
        return call()
    return _deep_thread().submit(call).result()


@functools.cache
def _deep_thread() -> ThreadPoolExecutor:
    before = threading.stack_size(_STACK_BYTES)
    try:
        executor = ThreadPoolExecutor(1, "lineloom-graph", initializer=_mark)
        executor.submit(int).result()  # has the thread start now, with this stack
    finally:
        threading.stack_size(before)
    return executor


def _mark() -> None:
    _inside.deep = True
