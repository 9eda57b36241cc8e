"""Compile in as many processes as there are cores, what mapping needs first."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lineloom_core.kernels import folders, kernel_target
from lineloom_core.kernels.target import target_name
from lineloom_core.warm_up.specialisations import MAPPING, REST, Specialisation

_MOST_PROCESSES = 6
"""More would wait for each other, each with 300 MB of a compiler."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far it is. task: what is compiled; maps: all that mapping needs is there."""

    done: int
    of: int
    task: str
    maps: bool

    def __str__(self) -> str:
        """Return it in a few words."""
        return f"{self.done} of {self.of}, now {self.task}"


def is_compiled() -> bool:
    """Return whether all of it is in the cache, or came with the wheel."""
    mark = Path(target_name(), _mark())
    places = (folders.writable(), folders.shipped("lineloom_core"))
    return any(place is not None and (place / mark).is_file() for place in places)


class Compiler:
    """Has every specialisation compiled in several processes, what mapping needs first.

    A kernel that several are made of is compiled by one process, and the others wait for it.
    """

    def __init__(
        self, report: Callable[[Progress], object] = lambda _: None, processes: int | None = None
    ) -> None:
        self._report = report
        self._processes = processes or min(_cores(), _MOST_PROCESSES)
        self._running: list[subprocess.Popen[str]] = []
        self._failed: int | None = None
        self._stopped = False
        self._left = deque((*MAPPING, *REST))
        self.of = len(self._left)
        self._done: set[Specialisation] = set()
        self._lock = threading.Lock()

    def run(self) -> None:
        """Return when all is compiled, or when stopped. Raises RuntimeError where that fails."""
        threads = [
            threading.Thread(target=self._through_a_process, daemon=True)
            for _ in range(self._processes)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if self._failed is not None:
            raise RuntimeError(f"a process that compiles kernels ended with {self._failed}")
        if not self._stopped:
            _leave_mark()

    def stop(self) -> None:
        """End the processes, whatever they are at."""
        with self._lock:
            self._stopped = True
            self._left.clear()
            for process in self._running:
                process.kill()

    def _through_a_process(self) -> None:
        with self._lock:
            if self._stopped:
                return
            process = _process()
            self._running.append(process)
        with process:
            while (chosen := self._next()) is not None and _compiled_by(process, chosen):
                with self._lock:
                    self._done.add(chosen)
                    self._tell(chosen)
        with self._lock:
            self._running.remove(process)
            if process.returncode and not self._stopped:
                self._failed = process.returncode
                self._left.clear()

    def _next(self) -> Specialisation | None:
        with self._lock:
            if not self._left:
                return None
            chosen = self._left.popleft()
            self._tell(chosen)
            return chosen

    def _tell(self, about: Specialisation) -> None:
        maps = self._done.issuperset(MAPPING)
        self._report(Progress(len(self._done), self.of, about.task, maps))


def _process() -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "lineloom_core.warm_up.child"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        # The same modules as here, wherever they were found.
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def _compiled_by(process: subprocess.Popen[str], chosen: Specialisation) -> bool:
    """Have a process compile one; False where it has ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.write(f"{chosen.kernel}|{chosen.arguments}\n")
        process.stdin.flush()
    return bool(process.stdout.readline())


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _mark() -> str:
    return f"complete-{kernel_target()[:16]}"


def _leave_mark() -> None:
    place = folders.writable()
    if place is not None:
        with contextlib.suppress(OSError):
            (place / target_name() / _mark()).touch()
