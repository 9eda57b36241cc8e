"""Where the service listens, what it says there, and what ends up in its log."""

from __future__ import annotations

import json
import os
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
import trustme
from lineloom.cli.app import app
from lineloom_service.server import run
from lineloom_service.settings import Settings
from typer.testing import CliRunner

from tests.service.fake_server import free_port


def _token(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, ["token", *(str(argument) for argument in arguments)])
    assert result.exit_code == 0, result.output
    return result.stdout.strip()


@contextmanager
def _served(
    directory: Path, verify: ssl.SSLContext | bool, *options: str
) -> Iterator[httpx.Client]:
    port = free_port()
    command = [sys.executable, "-m", "lineloom.cli", "serve", "--port", str(port)]
    command += ["--data-dir", str(directory), "--log-level", "debug", *options]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("LINELOOM_")}
    environment["LINELOOM_HEARTBEAT_S"] = "0.2"
    scheme = "http" if verify is True else "https"
    with (directory / "log").open("wb") as log:
        process = subprocess.Popen(command, stderr=log, stdout=log, env=environment)
    try:
        with httpx.Client(base_url=f"{scheme}://localhost:{port}", verify=verify) as client:
            for _ in range(1200):
                assert process.poll() is None, (directory / "log").read_text()
                try:
                    client.get("/healthz")
                    break
                except httpx.TransportError:
                    time.sleep(0.05)
            yield client
    finally:
        process.kill()
        process.wait()


def test_a_revoked_token_ends_what_it_listens_to(tmp_path: Path) -> None:
    scopes = ("--scope", "read", "--scope", "ingest")
    token = _token("create", *scopes, "--data-dir", tmp_path)
    scan = {"seq": 0, "stamp": 0.0, "angle_min": 0.0, "angle_increment": 0.1, "range_min": 0.1}
    with _served(tmp_path, True) as client:
        client.headers["Authorization"] = f"Bearer {token}"
        url = "/v1/sites/s/robots/r/scans"
        client.post(url, json={**scan, "range_max": 9.0, "ranges": [1.0]}).raise_for_status()
        with client.stream("GET", "/v1/sites/s/events", timeout=60.0) as response:
            lines = response.iter_lines()
            assert next(lines).startswith("id: ")
            assert any(line == ": ping" for line in lines)
            _token("revoke", token.split("_")[1], "--data-dir", tmp_path)
            for _ in lines:  # ends, or the test's client times out
                pass
        assert client.get("/v1/sites").status_code == 401


def test_tokens_for_scripts(tmp_path: Path) -> None:
    where = ("--data-dir", tmp_path, "--json")
    scopes = ("--scope", "ingest", "--site", "s", "--note", "r's own")
    made = json.loads(_token("create", *scopes, *where))
    (listed,) = json.loads(_token("list", *where))["tokens"]
    assert listed.items() <= made.items()
    assert made["token"].split("_")[1] == listed["id"]
    assert (listed["scopes"], listed["site"], listed["note"]) == (["ingest"], "s", "r's own")
    _token("revoke", listed["id"], "--data-dir", tmp_path)
    assert json.loads(_token("list", *where))["tokens"][0]["revoked"] > listed["created"]


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "lineloom.example"])
def test_without_tokens_it_does_not_listen_to_others(tmp_path: Path, host: str) -> None:
    with pytest.raises(SystemExit, match="reachable from outside"):
        run(Settings(data_dir=tmp_path, host=host))


def test_tls_a_token_and_a_log_without_it(tmp_path: Path) -> None:
    authority = trustme.CA()
    certificate = authority.issue_cert("localhost")
    chain, key = tmp_path / "chain.pem", tmp_path / "key.pem"
    chain.write_bytes(b"".join(blob.bytes() for blob in certificate.cert_chain_pems))
    certificate.private_key_pem.write_to_path(key)
    context = ssl.create_default_context()
    authority.configure_trust(context)
    token = _token("create", "--scope", "read", "--data-dir", tmp_path)
    options = ("--host", "0.0.0.0", "--ssl-certfile", str(chain), "--ssl-keyfile", str(key))
    with _served(tmp_path, context, *options) as client:
        assert client.get("/v1/sites").status_code == 401
        headers = {"Authorization": f"Bearer {token}"}
        response = client.get("/v1/sites", headers=headers)
        assert (response.status_code, response.json()) == (200, {"sites": []})
        assert "server" not in response.headers
        bad = {"Authorization": f"Bearer {token}x"}
        assert client.get("/v1/sites", headers=bad).status_code == 401
    log = (tmp_path / "log").read_text()
    assert "GET /v1/sites 401" in log
    assert "GET /v1/sites 200" in log  # at this level
    assert token.split("_", 2)[2] not in log
    assert "Bearer" not in log


def test_tls_needs_both_files() -> None:
    with pytest.raises(ValueError, match="go together"):
        Settings(ssl_certfile=Path("chain.pem"))


def test_the_life_of_a_token(tmp_path: Path) -> None:
    bound = ("--scope", "ingest", "--site", "s", "--robot", "r", "--note", "forklift")
    token = _token("create", *bound, "--data-dir", tmp_path)
    name = token.split("_")[1]
    listed = _token("list", "--data-dir", tmp_path)
    assert listed.startswith(f"{name}  ingest at s/r  made ")
    assert listed.endswith("forklift")
    assert token.split("_", 2)[2] not in listed
    _token("revoke", name, "--data-dir", tmp_path)
    assert "revoked" in _token("list", "--data-dir", tmp_path)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["create", "--scope", "rule"], "no scope 'rule'; there are ingest, read, operate"),
        (["create", "--scope", "read", "--site", "s", "--robot", "r"], "bound to a robot"),
        (["create", "--scope", "ingest", "--robot", "r"], "name the site as well"),
        (["revoke", "0" * 12], "no token 000000000000"),
    ],
)
def test_what_makes_no_sense_is_said(tmp_path: Path, arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["token", *arguments, "--data-dir", str(tmp_path)])
    assert result.exit_code == 1
    assert said in result.stderr


def test_the_origins_of_the_command_line_may_call(tmp_path: Path) -> None:
    origins = "https://a.example,https://b.example"
    with _served(tmp_path, True, "--allow-origins", origins) as client:
        for origin, allowed in (
            ("https://b.example", "https://b.example"),
            ("https://c.example", None),
        ):
            response = client.get("/healthz", headers={"Origin": origin})
            assert response.headers.get("access-control-allow-origin") == allowed


def test_origins_are_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINELOOM_ALLOW_ORIGINS", "https://a.example, https://b.example")
    assert Settings().allow_origins == ("https://a.example", "https://b.example")
