"""What of the docs the tests do not run, why, and of how many commands each reason is."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tests.docs.pages import Command


@dataclass(frozen=True, slots=True)
class Unrun:
    """Commands that begin with `start` (a regular expression); count: None for any number."""

    start: str
    count: int | None
    why: str

    def holds(self, command: Command) -> bool:
        """Whether the command is one of these."""
        return re.match(self.start, command.text.strip()) is not None


UNRUN = (
    Unrun(r"docker |export LINELOOM_DB_PASSWORD", 8, "no Docker engine where this is tested"),
    Unrun(r"cd |ros2 |colcon ", 5, "no ROS where this is tested"),
    Unrun(r"lineloom bridge", 1, "needs a robot; tests/clients/ros2 runs it"),
    Unrun(r"lineloom watch|lineloom events --follow", 2, "goes on until it is stopped"),
    Unrun(r"pip install ", 3, "would fetch the released package in place of this checkout's"),
    Unrun(r"\S+python -m lineloom_lab.evaluation.calibration", 1, "fits for many minutes"),
    Unrun(r"curl -s \S+/config/difference", 1, "404 here; tests/contract/test_config.py has it"),
    Unrun(r"\S+lineloom bench pairs", 1, "minutes on real pairs; tests/lab/evaluation has it"),
)

UNRUN_SPANS = (
    Unrun(r".*(…|[A-Z]{2,}|\bA B\b)", None, "a placeholder, not a command"),
    Unrun(r"lineloom db", None, "runs in the blocks, and in tests/service/test_keeping.py"),
    Unrun(r"lineloom serve", None, "runs in the blocks"),
    Unrun(r"lineloom bridge", None, "needs a robot; tests/clients/ros2 runs it"),
    Unrun(r"lineloom watch$|lineloom events --follow", None, "goes on until it is stopped"),
    Unrun(r"lineloom demo", None, "tests/clients/cli/test_demo.py runs it"),
    Unrun(r"lineloom bench", None, "minutes; tests/lab/evaluation runs parts"),
    Unrun(r"lineloom experiment", None, "minutes; tests/lab/experiments runs them"),
)
"""Likewise of the commands within the text, which come and go: none is counted."""


def why_not(command: Command, among: tuple[Unrun, ...]) -> Unrun | None:
    """Return the reason why a command is not run, if there is one."""
    return next((unrun for unrun in among if unrun.holds(command)), None)
