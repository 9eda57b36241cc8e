"""The first start on a machine: kernels are compiled beside the service, before its workers."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
import time

from lineloom_core.kernels.folders import can_keep
from lineloom_core.warm_up.compiling import Compiler, Progress, is_compiled

_LOG = logging.getLogger(__name__)
_LINE_S = 3.0


class Compilation:
    """Compiles what is not in the cache, in processes of its own, and says how far it is.

    The compiler's memory ends with those processes.
    """

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._compiler = Compiler(self._on_progress)
        self._told = 0.0
        self._maps = threading.Event()

    def reasons(self) -> list[str]:
        """Return how far it is, until all that mapping needs is there."""
        if self._maps.is_set() or self._progress is None:
            return []
        return [f"kernels are being compiled: {self._progress}"]

    async def until_it_maps(self) -> None:
        """Return when workers find what they need, or when it failed and they must compile."""
        if await asyncio.to_thread(is_compiled):
            return
        if not can_keep():
            _LOG.warning(
                "compiled kernels cannot be kept: every start compiles them again, for minutes; "
                "set LINELOOM_KERNEL_CACHE to a folder that can be written"
            )
            return
        self._on_progress(Progress(0, self._compiler.of, "matching", maps=False))
        threading.Thread(target=self._run, name="lineloom-compile", daemon=True).start()
        while not self._maps.is_set():
            await asyncio.sleep(0.05)

    def stop(self) -> None:
        """End it."""
        self._compiler.stop()

    def _run(self) -> None:
        try:
            self._compiler.run()
        except Exception:
            _LOG.exception("kernels were not compiled: each worker compiles them by itself")
        finally:
            self._maps.set()

    def _on_progress(self, progress: Progress) -> None:
        self._progress = progress
        if progress.maps:
            self._maps.set()
        done = progress.done == progress.of
        if sys.stderr.isatty():
            end = "\n" if done else ""
            sys.stderr.write(f"\r\x1b[Kcompiling kernels: {progress}{end}")
            sys.stderr.flush()
        elif done or time.monotonic() - self._told > _LINE_S:
            self._told = time.monotonic()
            _LOG.info("compiling kernels: %s", progress)
