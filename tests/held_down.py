"""Run a command as an old processor would: `python -m tests.held_down COMMAND...`.

Kernels are compiled for any x86-64, numpy's dispatch is held at its baseline, and OpenBLAS takes
the kernels of 2008. What a verdict must not hang on differs then: the last bits.
"""

from __future__ import annotations

import os
import sys

import numpy as np


def held_down() -> dict[str, str]:
    """Return the variables that hold this processor down; numpy warns of features it has not."""
    dispatched = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return {
        "NUMBA_CPU_NAME": "generic",
        "NPY_DISABLE_CPU_FEATURES": " ".join(dispatched),
        "OPENBLAS_CORETYPE": "Nehalem",
    }


if __name__ == "__main__":
    os.execvpe(sys.argv[1], sys.argv[1:], os.environ | held_down())
