"""A stranger's tool reads the OpenAPI document and tries everything: it finds nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from lineloom.cli.child_service import ChildService
from lineloom_service.security.token_book import create_token
from lineloom_service.settings import Settings
from lineloom_service.store.maintenance import run_beside

from tests.service.fake_server import free_port, server

CONFIG = Path(__file__).with_name("schemathesis.toml")
SCAN = {
    "stamp": 0.0,
    "angle_min": -0.6,
    "angle_increment": 0.1,
    "range_min": 0.1,
    "range_max": 30.0,
    "ranges": [2.42, 2.29, 2.17, 2.1, None, "inf"],
}


@contextmanager
def _token(directory: Path, port: int) -> Iterator[str]:
    """A token good for everything, and a site for the tool to find."""
    token, _ = run_beside(
        Settings(data_dir=directory),
        lambda connection: create_token(connection, ["ingest", "read", "operate"]),
    )
    headers = {"Authorization": f"Bearer {token}"}
    for robot in ("a", "b", "alone"):
        url = f"http://127.0.0.1:{port}/v1/sites/floor/robots/{robot}/scans"
        scans = [{**SCAN, "seq": seq} for seq in range(5)]
        httpx.post(url, json={"scans": scans}, headers=headers).raise_for_status()
    yield token


def _try_everything(port: int, token: str, directory: Path, examples: int) -> None:
    command = [str(Path(sys.executable).with_name("schemathesis")), "--config-file", str(CONFIG)]
    command += ["run", f"http://127.0.0.1:{port}/openapi.json", "--no-color"]
    # All but one: sites and robots are created on first use, so a PUT after a DELETE brings the
    # name back. That deleting leaves nothing is tested in test_actions.py and in the store's tests.
    command += ["--checks", "all", "--exclude-checks", "use_after_free"]
    command += ["--max-examples", str(examples), "--generation-deterministic"]
    command += ["--phases", "examples,coverage,fuzzing,stateful"]
    environment = {**os.environ, "LINELOOM_TOKEN": token}
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=directory, check=False
    )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
    assert "Stateful" in done.stdout
    assert "failed" not in done.stdout.split("SUMMARY")[-1]


def test_all_checks_on_all_calls(tmp_path: Path) -> None:
    port = free_port()
    with (
        server(tmp_path / "data", port, FAKE_MAPPER_GENTLE="1"),
        _token(tmp_path / "data", port) as token,
    ):
        _try_everything(port, token, tmp_path, examples=4)


@pytest.mark.long
def test_all_checks_on_all_calls_with_the_real_mapper(tmp_path: Path) -> None:
    child = ChildService(tmp_path / "data")
    child.start()
    try:
        child.wait_until_ready()
        with _token(tmp_path / "data", child.port) as token:
            _try_everything(child.port, token, tmp_path, examples=150)
    finally:
        child.stop()
