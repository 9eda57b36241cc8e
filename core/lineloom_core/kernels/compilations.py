"""What is compiled and not found in the cache."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event

_OURS = "lineloom"


class _Listener(event.Listener):
    def __init__(self, names: list[str]) -> None:
        self._names = names

    def on_start(self, event: Any) -> None:
        """Leave it until it is done."""

    def on_end(self, event: Any) -> None:
        """Note a kernel that has been compiled, and leave numba's own functions aside."""
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith(_OURS):
            self._names.append(f"{function.__module__}.{function.__name__}")


@contextmanager
def compilations() -> Iterator[list[str]]:
    """Collect the names of kernels that are compiled meanwhile, one for each specialisation."""
    names: list[str] = []
    with event.install_listener("numba:compile", _Listener(names)):
        yield names
