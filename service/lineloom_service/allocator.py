"""Have the C library give memory back that nothing holds any more.

Left to itself, glibc learns from the first large block that is freed to take such blocks from its
heaps from then on, and gives every thread a heap of its own. Views, snapshots and rendered maps
come and go on several threads: between what stays, their room was never given back, and the
service grew by a third within an hour of driving.
"""

from __future__ import annotations

import ctypes

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # malloc.h
_LARGE_BYTES = 256 * 1024
_ARENAS = 2


def give_back() -> bool:
    """Map large blocks by themselves, and share few heaps; call it before there are threads.

    Returns whether the C library knows how: glibc does, others are left as they are.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # musl, macOS, Windows
        return False
    mapped: bool = mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES) == 1
    shared: bool = mallopt(_M_ARENA_MAX, _ARENAS) == 1
    return mapped and shared
