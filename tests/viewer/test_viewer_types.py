"""The viewer's JSDoc types hold: TypeScript checks them, as strictly as it can."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

CONFIG = Path(__file__).with_name("tsconfig.json")
VIEWER = Path(__file__).parents[2] / "service" / "lineloom_service" / "viewer"
_INSTALLED = f"/tmp/lineloom-typescript-{os.getuid()}/node_modules/.bin/tsc"


@pytest.fixture(scope="module")
def tsc() -> str:
    path = shutil.which("tsc") or shutil.which(_INSTALLED)
    if path is None:
        pytest.skip("no TypeScript to check the viewer's types: `.ci/typescript` installs it")
    return path


def complaints(tsc: str, config: Path) -> list[str]:
    command = [tsc, "--project", str(config), "--pretty", "false"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.splitlines()


def test_the_viewer_s_types_hold(tsc: str) -> None:
    assert complaints(tsc, CONFIG) == []


def test_a_wrong_type_in_it_is_found(tsc: str, tmp_path: Path) -> None:
    shutil.copytree(VIEWER, tmp_path / "viewer")
    camera = tmp_path / "viewer" / "draw" / "camera.js"
    camera.write_text(camera.read_text() + '\nnew Camera().pan("far", 1);\n')
    config = json.loads(CONFIG.read_text()) | {"include": ["viewer/draw/camera.js"]}
    (tmp_path / "tsconfig.json").write_text(json.dumps(config))
    (found,) = complaints(tsc, tmp_path / "tsconfig.json")
    assert "camera.js" in found
    assert "'string' is not assignable to parameter of type 'number'" in found
