"""The image and the compose file: what they say, their steps, and the image with an engine."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from lineloom_service.settings import Settings

from tests.docker.dockerfile import Run, Step, read
from tests.service.fake_server import free_port

ROOT = Path(__file__).parents[2]
STEPS = read(ROOT / "docker" / "Dockerfile")
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text())


def _last(name: str) -> Step:
    return [step for step in STEPS if step.name == name][-1]


def test_two_stages_and_the_second_has_no_sources() -> None:
    starts = [number for number, step in enumerate(STEPS) if step.name == "FROM"]
    assert len(starts) == 2
    copied = [step.rest for step in STEPS[starts[1] :] if step.name == "COPY"]
    assert copied == [
        "--from=build /opt/lineloom /opt/lineloom",
        "docker/healthcheck.py /opt/lineloom/healthcheck.py",
    ]


def test_dependencies_come_before_sources_and_pip_stays_behind() -> None:
    rests = [step.rest for step in STEPS]
    others = next(i for i, rest in enumerate(rests) if "requirements.txt" in rest)
    kernels = next(i for i, rest in enumerate(rests) if "warm_up" in rest)
    core, service = rests.index("core core"), rests.index("service service")
    assert others < core < kernels < service
    assert "python3 -m venv --without-pip /opt/lineloom" in " ".join(rests)
    # The base is one argument for both stages.
    assert [s.rest.split()[0] for s in STEPS if s.name == "FROM"] == 2 * ["${BASE}"]


def test_old_engines_understand_the_health_check() -> None:
    assert "--start-interval" not in _last("HEALTHCHECK").rest


def test_what_is_asked_for_of_others_is_all_and_nothing_of_ours() -> None:
    folders = [str(ROOT / name) for name in ("core", "clients/python", "service")]
    command = [sys.executable, str(ROOT / "docker" / "requirements.py"), *folders]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert not [line for line in lines if line.startswith("lineloom")]
    names = {re.split(r"[^\w.-]", line)[0] for line in lines}
    assert {"numba", "gtsam", "httpx", "fastapi", "backports.zstd"} <= names


@pytest.mark.long
def test_the_image_is_built_and_run() -> None:
    done = subprocess.run([ROOT / "docker" / "check"], capture_output=True, text=True, check=False)
    if done.returncode == 3:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr


def test_it_runs_as_nobody_in_particular() -> None:
    names = [step.name for step in STEPS]
    assert _last("USER").rest == "10001"
    # What it compiles further is its user's to keep.
    assert "--owner lineloom /data /var/cache/lineloom" in " ".join(s.rest for s in STEPS)
    assert names.index("USER") < names.index("CMD")


def test_what_is_copied_is_there() -> None:
    for step in STEPS:
        if step.name == "COPY" and not step.rest.startswith("--"):
            *sources, _ = step.rest.split()
            assert all((ROOT / source).exists() for source in sources), step.rest


def test_every_variable_is_a_setting() -> None:
    known = {f"LINELOOM_{name.upper()}" for name in Settings.model_fields}
    told = {part.partition("=")[0] for s in STEPS if s.name == "ENV" for part in s.rest.split()}
    for service in COMPOSE["services"].values():
        told |= set(service.get("environment", {}))
    assert {name for name in told if name.startswith("LINELOOM_")} <= known


def test_there_is_time_to_stop() -> None:
    given = COMPOSE["services"]["worker"]["stop_grace_period"]
    assert int(given.removesuffix("s")) > Settings().stop_grace_s + 5 + 5  # as server.py has them


def test_compose_has_a_service_a_worker_and_a_database() -> None:
    services = COMPOSE["services"]
    assert set(services) == {"database", "service", "worker"}
    assert services["service"]["environment"]["LINELOOM_ENGINE"] == "off"
    assert services["worker"]["environment"]["LINELOOM_ENGINE"] == "standby"
    for name in ("service", "worker"):
        service = services[name]
        Settings(
            engine=service["environment"]["LINELOOM_ENGINE"],
            database_url=service["environment"]["LINELOOM_DATABASE_URL"],
        )
        assert service["depends_on"] == {"database": {"condition": "service_healthy"}}
        assert service["read_only"] is True
        assert service["cap_drop"] == ["ALL"]
    assert "ports" not in services["database"]
    assert "ports" not in services["worker"]
    assert "pg_isready" in str(services["database"]["healthcheck"]["test"])
    declared = set(COMPOSE["volumes"])
    used = {volume.split(":")[0] for s in services.values() for volume in s["volumes"]}
    assert used == declared


def test_a_workers_history_goes_to_the_disk() -> None:
    worker = COMPOSE["services"]["worker"]
    folder = worker["environment"]["TMPDIR"]
    assert not any(folder.startswith(memory) for memory in worker["tmpfs"])
    assert f"VOLUME {folder}" in (ROOT / "docker" / "Dockerfile").read_text()


def test_compose_brings_no_password() -> None:
    text = (ROOT / "docker" / "compose.yaml").read_text()
    for line in text.splitlines():
        if "PASSWORD" in line:
            assert "${LINELOOM_DB_PASSWORD:?" in line, line


@pytest.mark.long
def test_the_dockerfiles_steps_end_in_a_healthy_service(tmp_path: Path) -> None:
    run = Run(tmp_path / "image", ROOT)
    for path in ("/data", "/var/cache/lineloom"):
        run.at(path).mkdir(parents=True)
    for step in STEPS:
        run.take(step)
    assert list(run.at("/opt/lineloom").rglob("_compiled/generic-*/complete-*"))
    run.environment["LINELOOM_PORT"] = str(free_port())
    program = str(run.at("/opt/lineloom/bin/lineloom"))
    assert run.last["ENTRYPOINT"] == ["lineloom"]
    refused = subprocess.run(
        [program, *run.last["CMD"]], env=run._all(), capture_output=True, text=True, check=False
    )
    assert refused.returncode != 0
    assert "create a token" in refused.stderr
    run.call([program, "token", "create", "--scope", "read"])
    process = run.start([program, *run.last["CMD"]], tmp_path / "log")
    try:
        started = time.monotonic()
        health = [str(run.at("/opt/lineloom/bin/python")), *run.last["HEALTHCHECK"][1:]]
        while subprocess.run(health, env=run._all(), check=False).returncode:
            assert process.poll() is None, (tmp_path / "log").read_text()
            assert time.monotonic() - started < 120.0
            time.sleep(1.0)
        url = f"http://127.0.0.1:{run.environment['LINELOOM_PORT']}"
        assert httpx.get(f"{url}/v1/sites").status_code == 401
        process.terminate()
        assert process.wait(20.0) in (0, -15)
    finally:
        process.kill()
