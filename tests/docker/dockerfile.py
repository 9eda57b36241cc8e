"""Reads a Dockerfile, and runs its steps in a folder instead of in a container."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

_OF_THE_SYSTEM = ("/opt", "/src", "/data", "/var/cache")
"""Paths of the image that the steps write to; they become folders below the root."""


@dataclass(frozen=True, slots=True)
class Step:
    """One instruction, its continuation lines joined."""

    name: str
    rest: str


def read(path: Path) -> list[Step]:
    """Return the instructions in order."""
    text = re.sub(r"\\\n\s*", " ", path.read_text(encoding="utf-8"))
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return [Step(*line.split(None, 1)) for line in lines]


@dataclass(slots=True)
class Run:
    """A run of the steps. root: where the image's paths are. source: the build's context."""

    root: Path
    source: Path
    environment: dict[str, str] = field(default_factory=dict)
    folder: str = "/src"
    last: dict[str, list[str]] = field(default_factory=dict)

    def take(self, step: Step) -> None:
        """Do what an instruction says. Of stages there is one: what is copied between is there."""
        if step.name == "WORKDIR":
            self.folder = step.rest
            self.at(step.rest).mkdir(parents=True, exist_ok=True)
        elif step.name == "COPY" and not step.rest.startswith("--from"):
            *sources, target = shlex.split(step.rest)
            self._copy(sources, target)
        elif step.name == "ENV":
            for part in shlex.split(step.rest):
                name, _, value = part.partition("=")
                expanded = re.sub(r"\$(\w+)", lambda m: self._all()[m[1]], self._moved(value))
                self.environment[name] = expanded
        elif step.name == "ARG":
            name, _, value = step.rest.partition("=")
            self.environment[name] = value
        elif step.name == "RUN" and "useradd" not in step.rest:
            self.call(["/bin/sh", "-c", self._moved(step.rest)])
        elif step.name in ("ENTRYPOINT", "CMD", "HEALTHCHECK"):
            command = step.rest[step.rest.index("[") :]
            self.last[step.name] = [self._moved(part) for part in json.loads(command)]

    def at(self, path: str) -> Path:
        """Return where a path of the image is."""
        return self.root / (path if path.startswith("/") else f"{self.folder}/{path}").lstrip("/")

    def call(self, command: list[str]) -> None:
        """Run a command as a step."""
        folder = self.at(self.folder)
        subprocess.run(command, cwd=folder, env=self._all(), check=True, stdout=sys.stderr)

    def start(self, command: list[str], log: Path) -> subprocess.Popen[bytes]:
        """Start a command as the container's own."""
        with log.open("wb") as file:
            return subprocess.Popen(command, cwd=self.root, env=self._all(), stderr=file)

    def _all(self) -> dict[str, str]:
        kept = {name: os.environ[name] for name in os.environ if not name.startswith("LINELOOM_")}
        # The image's `python` is the one that runs the tests.
        path = f"{Path(sys.base_prefix) / 'bin'}:{kept['PATH']}"
        return {**kept, "PATH": path, "HOME": str(self.root), **self.environment}

    def _copy(self, sources: list[str], target: str) -> None:
        for name in sources:
            source, goal = self.source / name, self.at(target)
            if source.is_dir():
                ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", ".venv")
                shutil.copytree(source, goal, ignore=ignored, dirs_exist_ok=True)
            else:
                goal = goal / source.name if target.endswith("/") else goal
                goal.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source, goal)

    def _moved(self, text: str) -> str:
        for path in _OF_THE_SYSTEM:
            text = re.sub(rf"(?<![\w./]){path}(?=/|\b)", str(self.root) + path, text)
        return text
