"""The one way to compile a function: `@kernel`, whose machine code is kept and is never stale."""

from lineloom_core.kernels.dispatcher import kernel
from lineloom_core.kernels.target import kernel_target

__all__ = ["kernel", "kernel_target"]
