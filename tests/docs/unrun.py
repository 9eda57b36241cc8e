"""What of the docs the tests do not run, why, and how many commands each reason holds back."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tests.docs.pages import Command


@dataclass(frozen=True, slots=True)
class Unrun:
    """Commands of the sh blocks that begin with `start` (a regular expression)."""

    start: str
    count: int
    why: str

    def holds(self, command: Command) -> bool:
        """Whether the command is one of these."""
        return re.match(self.start, command.text.strip()) is not None


UNRUN = (
    Unrun(r"docker |export LINELOOM_DB_PASSWORD", 8, "no Docker engine where this is tested"),
    Unrun(r"cd |ros2 |colcon ", 4, "no ROS where this is tested"),
    Unrun(r"pip install ", 2, "would fetch the released package in place of this checkout's"),
    Unrun(r"\S+python -m lineloom_core.evaluation.calibration", 1, "fits for many minutes"),
    Unrun(r"\S+lineloom bench pairs", 1, "minutes on real pairs; tests/core/evaluation has it"),
)

UNRUN_SPANS = (
    Unrun(r".*(…|[A-Z]{2,}|\bA B\b)", 9, "a placeholder, not a command"),
    Unrun(r"lineloom serve", 6, "runs in the blocks"),
    Unrun(r"lineloom demo", 1, "tests/clients/cli/test_demo.py runs it"),
    Unrun(r"lineloom bench", 5, "minutes; tests/core/evaluation runs parts"),
    Unrun(r"lineloom experiment", 2, "minutes; tests/core/experiments runs them"),
)
"""Likewise of the commands within the text."""


def why_not(command: Command, among: tuple[Unrun, ...]) -> Unrun | None:
    """Return the reason why a command is not run, if there is one."""
    return next((unrun for unrun in among if unrun.holds(command)), None)
