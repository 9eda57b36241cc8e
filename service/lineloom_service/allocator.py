"""Have the C library give memory back that nothing holds any more.

Left to itself, glibc learns from the first large block that is freed to take such blocks from its
heaps from then on, and gives every thread a heap of its own. Views, snapshots and rendered maps
come and go on several threads: between what stays, their room was never given back, and the
service grew by a third within an hour of driving. A worker has one thread and few large blocks: for
it, mapping them costs 3 % and brings little; it trims its heap from time to time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # malloc.h
_LARGE_BYTES = 256 * 1024
_ARENAS = 2


def give_back() -> bool:
    """Map large blocks by themselves, and share few heaps; call it before there are threads.

    Returns whether the C library knows how: glibc does, others are left as they are.
    """
    mallopt = _find("mallopt")
    if mallopt is None:
        return False
    mapped: bool = mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES) == 1
    shared: bool = mallopt(_M_ARENA_MAX, _ARENAS) == 1
    return mapped and shared


def trim() -> None:
    """Give back what is free between what stays: takes 15 ms for a heap of 200 MB."""
    malloc_trim = _find("malloc_trim")
    if malloc_trim is not None:
        malloc_trim(0)


def _find(function: str) -> Callable[..., int] | None:
    """A function of the C library; None where it has none such (musl, macOS, Windows)."""
    try:
        found: Callable[..., int] = getattr(ctypes.CDLL(None), function)
    except (AttributeError, OSError, TypeError):
        return None
    return found
