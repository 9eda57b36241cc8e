"""Runs a page's commands in one shell, so that what one sets the next one has."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.docs.pages import Command


@dataclass(frozen=True, slots=True)
class Done:
    """A command, and what it printed on stdout."""

    command: Command
    output: str


def run(
    commands: list[Command], told: Mapping[str, str], folder: Path, variables: Mapping[str, str]
) -> list[Done]:
    """Run them in order; the first that fails, or ends in a traceback, fails the test.

    told: texts in the commands, and what to take in their places.
    """
    script = folder / "page.sh"
    script.write_text("set -eu -o pipefail\n" + "".join(_steps(commands, told)))
    shell = subprocess.run(
        ["bash", str(script)],
        cwd=folder,
        env=dict(variables),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    done = [Done(c, _read(folder / f"out.{n}")) for n, c in enumerate(commands)]
    started = [n for n in range(len(commands)) if (folder / f"out.{n}").exists()]
    errors = [_read(folder / f"err.{n}") for n in started]
    if shell.returncode != 0:
        last = started[-1] if started else 0
        said = f"{done[last].output}\n{errors[-1] if errors else ''}{shell.stderr}"
        raise AssertionError(
            f"{commands[last].page}: code {shell.returncode} of\n{commands[last].text}{said}"
        )
    assert not [error for error in errors if "Traceback" in error]
    return done


def _steps(commands: list[Command], told: Mapping[str, str]) -> list[str]:
    steps = []
    for number, command in enumerate(commands):
        text = command.text
        for shown, meant in told.items():
            text = text.replace(shown, meant)
        steps.append(f"{{\n{text}}} >out.{number} 2>err.{number}\n")
    return steps


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
