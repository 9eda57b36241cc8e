"""A package of two kernels in a folder of its own, run in processes of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

FACTOR = "FACTOR = 2.0\n"
INNER = """
from lineloom_core.kernels import kernel
from tiny.factor import FACTOR

@kernel
def inner(x):
    return FACTOR * x
"""
OUTER = """
from lineloom_core.kernels import kernel
from tiny.inner import inner

@kernel
def outer(x):
    return inner(x) + 1
"""
RUN = """
import json, sys
from numba.core.event import install_recorder
from lineloom_core.kernels import kernel_target
from tiny.outer import outer

arguments = json.loads(sys.argv[1])
with install_recorder("numba:compile") as events:
    results = [outer(tuple(a) if isinstance(a, list) else a) for a in arguments]
compiled = [e.data["dispatcher"].py_func.__name__ for _, e in events.buffer if e.is_start]
ours = [name for name in compiled if name in ("inner", "outer")]
print(json.dumps({"results": results, "compiled": ours, "target": kernel_target("tiny")}))
"""


@dataclass(frozen=True)
class Ran:
    """What one process found. compiled: names of kernels, in order; said: its stderr."""

    results: list[float]
    compiled: list[str]
    target: str
    said: str


class TinyPackage:
    """`tiny`: outer(x) = inner(x) + 1, inner(x) = FACTOR x, each name in a file of its own."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "tree"
        self.cache = folder / "cache"
        (self.root / "tiny").mkdir(parents=True)
        for name, text in {
            "__init__": "",
            "factor": FACTOR,
            "inner": INNER,
            "outer": OUTER,
        }.items():
            self.write(name, text)

    def write(self, name: str, text: str) -> None:
        """Put a file of the package there."""
        (self.root / "tiny" / f"{name}.py").write_text(text)

    def start(self, *arguments: float, **environment: str) -> subprocess.Popen[str]:
        """Call outer for each argument in a new process."""
        path = os.pathsep.join([str(self.root), *sys.path])
        given = {"PYTHONPATH": path, "LINELOOM_KERNEL_CACHE": str(self.cache), **environment}
        return subprocess.Popen(
            [sys.executable, "-B", "-c", RUN, json.dumps(arguments)],
            env={**os.environ, **given},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *arguments: float, **environment: str) -> Ran:
        """Call outer for each argument in a new process and wait for it."""
        return finish(self.start(*arguments, **environment))

    def kept(self) -> list[Path]:
        """Return the files of machine code."""
        return sorted(self.cache.rglob("*.nbc"))


def finish(process: subprocess.Popen[str]) -> Ran:
    """Wait for a process that `start` began."""
    told, said = process.communicate(timeout=120.0)
    assert process.returncode == 0, said
    return Ran(**json.loads(told), said=said)
