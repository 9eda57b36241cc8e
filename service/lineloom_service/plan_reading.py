"""Floor plans are read in a process of their own, which may fail as it likes.

A drawing of a few kilobytes can mean any number of lines, or a circle that takes all memory there
is, and no reader of drawings stops at that. `python -m lineloom_service.plan_reading` is
that process: a plan comes in, lines go out.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
import sys
from dataclasses import dataclass
from typing import cast

import numpy as np
from lineloom_core.floorplan.plan import FloorPlan, FloorPlanError
from lineloom_core.io.floorplan_files import PlanFormat, read_plan

_AT_A_TIME = 2
_REFUSED = 3
"""The exit code that goes with a reason."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Of one plan. memory: of address space [bytes]; Python and its libraries take a tenth."""

    cpu_s: int = 20
    wall_s: float = 40.0
    memory: int = 1024 * 1024 * 1024


class PlanReader:
    """Reads plans, a few at a time: others wait."""

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._turns = asyncio.Semaphore(_AT_A_TIME)

    async def read(self, content: bytes, format: PlanFormat) -> FloorPlan:
        """Return the plan in metres. Raises FloorPlanError saying what is wrong, and where."""
        async with self._turns:
            code, lines, told = await _run(content, format, self._limits)
        if code == _REFUSED:
            raise FloorPlanError(told.decode(errors="replace"))
        if code != 0:
            most = self._limits
            raise FloorPlanError(
                f"takes more than {most.cpu_s} s or {most.memory >> 20} MiB to read: draw it with "
                "fewer lines, and take blocks and curves apart"
            )
        return FloorPlan.of(np.frombuffer(lines, dtype="<f8").reshape(-1, 4))


async def _run(content: bytes, format: PlanFormat, most: Limits) -> tuple[int, bytes, bytes]:
    """Return how the process ended, and what it wrote."""
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", "lineloom_service.plan_reading",
        format, str(most.cpu_s), str(most.memory),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        # The same modules as here. Each thread of a library would take of the address space.
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    try:
        async with asyncio.timeout(most.wall_s):
            lines, told = await child.communicate(content)
    except TimeoutError:
        return -1, b"", b""
    finally:
        if child.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                child.kill()
            await child.wait()
    return child.returncode or 0, lines, told


def _limit(cpu_s: int, memory: int) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError, ValueError):  # not every system has this one
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    with contextlib.suppress(OSError):
        os.nice(10)  # answers and mapping go before


def main() -> None:
    """Be the process."""
    format, cpu_s, memory = sys.argv[1:]
    _limit(int(cpu_s), int(memory))
    content = sys.stdin.buffer.read()
    try:
        plan = read_plan(content, cast(PlanFormat, format))
    except FloorPlanError as error:
        sys.stderr.write(str(error))
        sys.exit(_REFUSED)
    sys.stdout.buffer.write(np.ascontiguousarray(plan.lines, dtype="<f8").tobytes())


if __name__ == "__main__":
    main()
