"""`lineloom experiment` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

from lineloom.cli.app import app
from typer.testing import CliRunner, Result


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["experiment", *map(str, arguments)])


def test_the_list_names_all() -> None:
    result = run("--list")
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) == 6
    assert result.stdout.startswith("closed-path ")


def test_a_quick_run_writes_report_and_figures(tmp_path: Path) -> None:
    result = run("sparse-path", "--quick", "--output", tmp_path / "new", "--seed", "2")
    assert result.exit_code == 0, result.output
    assert "| right (< 0.3 m, < 5°)" in result.stdout
    names = {path.name for path in (tmp_path / "new").iterdir()}
    assert {"sparse-path.md", "sparse-path.json", "sparse-path-map.png"} <= names
    written = json.loads((tmp_path / "new" / "sparse-path.json").read_text(encoding="utf-8"))
    assert written["parameters"]["seed"] == 2


def test_json_is_one_document() -> None:
    result = run("error-area", "--quick", "--matcher", "default", "--json")
    assert result.exit_code == 0, result.output
    assert set(json.loads(result.stdout)["matchers"]) == {"default"}


def test_a_wrong_name_lists_the_right_ones() -> None:
    result = run("sparse")
    assert result.exit_code == 2
    assert "sparse-path" in result.stderr
    assert run().exit_code == 2


def test_only_the_closed_path_runs_through_a_service() -> None:
    refused = run("timing", "--quick", "--url", "http://127.0.0.1:9")
    assert refused.exit_code == 2
    assert "closed-path and sparse-path do" in refused.stderr
    assert run("sparse-path", "--scans", "40").exit_code == 2


def test_missing_data_is_said_plainly(tmp_path: Path) -> None:
    result = run("real-scans", "--quick", "--data", tmp_path)
    assert result.exit_code == 1
    assert "fr079.log, which does not exist" in result.stderr
