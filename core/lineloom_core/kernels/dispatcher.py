"""The decorator of kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, overload

from numba.core import config
from numba.core.registry import CPUDispatcher
from numba.core.types.misc import unliteral

from lineloom_core.kernels.cache import KernelCache
from lineloom_core.kernels.target import OPTIONS, apply_choice


@overload
def kernel(function: Callable[..., Any], /) -> Any: ...
@overload
def kernel(*, nogil: bool) -> Callable[[Callable[..., Any]], Any]: ...
def kernel(function: Callable[..., Any] | None = None, /, *, nogil: bool = False) -> Any:
    """Compile a function on its first call, or load what is compiled from all the same sources.

    nogil: other threads run meanwhile. Raises ValueError where LINELOOM_KERNELS is nonsense.
    """
    if function is None:
        return lambda decorated: _compiled(decorated, {"nogil": nogil})
    return _compiled(function, {})


def _compiled(function: Callable[..., Any], options: dict[str, bool]) -> Any:
    if config.DISABLE_JIT:
        return function
    apply_choice()
    made = _Kernel(py_func=function, targetoptions={**OPTIONS, **options})
    made.enable_caching()
    return made


class _Kernel(CPUDispatcher):
    def enable_caching(self) -> None:
        """Keep machine code in folders of our own."""
        self._cache = KernelCache(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile once for all integers, not again for each constant that a caller passes."""
        kws = {name: unliteral(t) for name, t in kws.items()}
        return super().get_call_template([unliteral(t) for t in args], kws)

    def compile(self, sig: Any) -> Any:
        """Compile or load for a signature; one process compiles and others wait for it."""
        held = self._cache.claims
        try:
            return super().compile(sig)
        finally:
            self._cache.release(held)
