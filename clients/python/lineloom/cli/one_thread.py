"""One thread per process while benchmarks run."""

from __future__ import annotations

import os

_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def use_one_thread() -> None:
    """Keep numeric libraries to one thread; call it before the core is loaded.

    Threads that wait for work would count as CPU time.
    """
    for variable in _VARIABLES:
        os.environ.setdefault(variable, "1")
