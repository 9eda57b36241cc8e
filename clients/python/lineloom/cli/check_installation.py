"""Whether what is installed here works."""

from __future__ import annotations

import importlib.metadata
import platform
import sys
from collections.abc import Iterator

from lineloom.cli.checkup import Finding, noted, ok, wrong

_OWN = ("lineloom-client", "lineloom-core", "lineloom-service")
_INSTALL = "pip install lineloom-client[server]"


def check_installation() -> Iterator[Finding]:
    """Yield what is found of Python, the packages, gtsam and the compiled kernels."""
    yield ok("python", f"{platform.python_version()}, {sys.executable}")
    yield from _packages()
    if _installed("lineloom-core") is None:
        return
    yield _gtsam()
    yield _kernels()


def _packages() -> Iterator[Finding]:
    versions = {name: _installed(name) for name in _OWN}
    own = versions["lineloom-client"]
    for name, version in versions.items():
        if version is None:
            yield noted(name, "not installed: this machine is a client only", f"`{_INSTALL}`")
        elif version != own:
            advice = f"install the same version of all: `{_INSTALL}=={own}`"
            yield wrong(name, f"{version}, but lineloom-client is {own}", advice)
        else:
            yield ok(name, version)


def _gtsam() -> Finding:
    """Solve a graph of two poses: a broken build fails here and not in the middle of a map."""
    try:
        import gtsam
        import numpy as np

        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.ones(3))
        graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(0.0, 0.0, 0.0), noise))
        graph.add(gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(1.0, 0.0, 0.0), noise))
        values.insert(0, gtsam.Pose2(0.1, 0.0, 0.0))
        values.insert(1, gtsam.Pose2(0.5, 0.2, 0.0))
        solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize().atPose2(1)
    except Exception as error:  # whatever it is: it is the finding
        return wrong("gtsam", f"does not work: {error}", f"`{_INSTALL}` again, in a fresh .venv")
    version = _installed("gtsam")
    if abs(solved.x() - 1.0) > 1e-6:
        return wrong("gtsam", f"{version} solves wrongly", "install gtsam 4.3 or newer")
    return ok("gtsam", f"{version}, solves")


def _kernels() -> Finding:
    """Look whether compiled kernels can be kept; without, every start compiles for minutes."""
    try:
        import numba
        from lineloom_core.kernels import folders
        from lineloom_core.kernels.target import target_name

        target = target_name()
    except Exception as error:
        return wrong("numba", f"does not work: {error}", f"`{_INSTALL}` again, in a fresh .venv")
    place, version = folders.writable(), numba.__version__
    kept = folders.kept("lineloom_core", target)
    if kept:
        return ok("numba", f"{version}, {kept} kernels compiled for {target}")
    if not folders.can_keep():
        advice = f"set {folders.SETTING} to a folder that can be written"
        return noted("numba", f"{place or 'nowhere'}: nothing compiled can be kept", advice)
    return ok("numba", f"{version}, nothing compiled yet: the first start takes a minute")


def _installed(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
