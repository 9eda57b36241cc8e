"""For which processor kernels are compiled, and by what."""

from __future__ import annotations

import logging
import os
import platform
import sys
from functools import cache
from hashlib import sha256

import llvmlite
import numba
import numpy as np
from numba.core import config
from numba.core.codegen import get_host_cpu_features
from numba.core.registry import cpu_target

from lineloom_core.kernels.folders import shipped
from lineloom_core.kernels.sources import digest_of, kernel_files, module_name

_LOG = logging.getLogger(__name__)

SETTING = "LINELOOM_KERNELS"
GENERIC = "generic"
OPTIONS = {"nopython": True}
"""How every kernel is compiled."""


def kernel_target(package: str = "lineloom_core") -> str:
    """Return a hash of all that makes a package's machine code what it is.

    Its kernels' sources, the compiler and the processor: two processes with the same target
    compute the same bits. Compiles nothing.
    """
    digest = sha256(target_name().encode())
    for file in kernel_files(package):
        digest.update(digest_of(module_name(file, package)).encode())
    return digest.hexdigest()


@cache
def target_name() -> str:
    """Return the name of the folder for this processor and compiler: its model and a hash."""
    apply_choice()
    return _named(
        config.CPU_NAME or llvmlite.binding.get_host_cpu_name(),
        get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES,
    )


def _named(processor: str, features: str) -> str:
    made_by = (
        f"{processor} {features} {sys.platform} {platform.machine()} {OPTIONS} "
        f"numba {numba.__version__} llvmlite {llvmlite.__version__} "
        f"numpy {np.__version__.rpartition('.')[0]} {sys.implementation.cache_tag}"
    )
    return f"{processor}-{sha256(made_by.encode()).hexdigest()[:16]}"


@cache
def apply_choice() -> None:
    """Have numba compile for what LINELOOM_KERNELS says; before its first kernel, or not at all.

    Raises ValueError where that is neither native, generic nor auto.
    """
    wish = os.environ.get(SETTING, "") or "auto"
    if wish not in ("native", GENERIC, "auto"):
        raise ValueError(f"{SETTING} must be native, generic or auto, not {wish!r}")
    if config.CPU_NAME is not None or wish == "native":
        return  # NUMBA_CPU_NAME goes first
    if wish == "auto" and not (shipped("lineloom_core") / _named(GENERIC, "")).is_dir():
        return
    if "_toplevel_target_context" in vars(cpu_target):
        if wish == GENERIC:
            _LOG.warning("%s=generic comes too late: numba has compiled already", SETTING)
        return
    config.CPU_NAME, config.CPU_FEATURES = GENERIC, ""
