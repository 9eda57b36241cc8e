"""Code that has changed since a site was saved makes its map anew, with its own gates."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import lineloom_core

ROOT = Path(__file__).parents[2]
PACKAGE = Path(lineloom_core.__file__).parent


def _map(directory: Path, first_of_path: Path | None = None) -> dict[str, Any]:
    path = [str(first_of_path)] if first_of_path else []
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "service" / "map_once.py"), str(directory)],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([*path, *sys.path])},
        check=True,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _with_a_field_in_the_middle(directory: Path) -> Path:
    """A copy of the core whose `JoinConfig` has a new parameter before `least_evidence`."""
    copy = Path(shutil.copytree(PACKAGE, directory / "lineloom_core"))
    config = copy / "mapping" / "config.py"
    text = config.read_text(encoding="utf-8")
    field = "    least_evidence: float = parameter(20.0"
    assert text.count(field) == 1
    added = '    added: float = parameter(2.0, "", "nothing yet")\n'
    config.write_text(text.replace(field, added + field), encoding="utf-8")
    return directory


def test_a_new_parameter_moves_no_gate_of_a_stored_site(tmp_path: Path) -> None:
    directory = tmp_path / "data"
    first = _map(directory)
    assert first["mapped"] > 300
    again = _map(directory)
    assert (again["mapped"], again["view"]) == (0, first["view"]), "it was saved"

    changed = _map(directory, _with_a_field_in_the_middle(tmp_path / "copy"))
    assert changed["fields"].index("added") < changed["fields"].index("least_evidence")
    assert changed["mapped"] == first["mapped"], "from the log, not from the other's snapshot"
    assert (changed["gate"], first["gate"]) == (20.0, 20.0)
    assert changed["view"] == first["view"]
