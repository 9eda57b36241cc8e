"""Every setting, route, metric, command, finding and reason to wait is told of in the docs."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from lineloom.cli.app import app as command_line
from lineloom.wire import Readiness
from lineloom_core.check import Checks
from lineloom_core.checks import DOUBTED, JOINED, RECOGNISED, WIDE_LOOP
from lineloom_core.mapping.config import MapperConfig
from lineloom_service.app import create_app
from lineloom_service.errors import KINDS
from lineloom_service.observation.durations import Durations, Histogram
from lineloom_service.observation.metrics import Metrics
from lineloom_service.settings import Settings

from tests.docs.curl import requests
from tests.docs.pages import ROOT, command_lines, pages

CORE = ROOT / "core" / "lineloom_core"


@pytest.fixture(scope="module")
def openapi(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return create_app(Settings(data_dir=tmp_path_factory.mktemp("data"))).openapi()


def told(name: str) -> bool:
    """Whether any page has it by itself, not as a part of a longer name."""
    word = re.compile(rf"(?<![\w-]){re.escape(name)}(?![\w-])")
    return any(word.search(text) for text in pages().values())


def commands(group: Any, *above: str) -> Iterator[str]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, *above, name)
        else:
            yield " ".join((*above, name))


def metric_names() -> list[str]:
    metrics = Metrics()
    ready = Readiness(takes_scans=True, maps=True, reasons=[])
    metrics.watch(lambda: [], Durations, Histogram(), lambda: ready)
    suffix = {"counter": "_total", "info": "_info"}
    return [f"{f.name}{suffix.get(f.type, '')}" for f in metrics.registry.collect()]


def finding_names() -> set[str]:
    return {
        node.args[0].value
        for path in (CORE / "health").glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "Finding"
        and node.args
        and isinstance(node.args[0], ast.Constant)
        and isinstance(node.args[0].value, str)
    }


def test_every_setting() -> None:
    names = [f"LINELOOM_{name.upper()}" for name in Settings.model_fields]
    names += ["LINELOOM_URL", "LINELOOM_TOKEN", "LINELOOM_SITE"]
    assert [name for name in names if not told(name)] == []


def test_every_route_has_a_curl_line_and_every_curl_line_a_route(openapi: dict[str, Any]) -> None:
    routes = {
        (method.upper(), path): re.compile(re.sub(r"\{\w+\}", "[^/]+", path) + "$")
        for path, methods in openapi["paths"].items()
        for method in methods
    }
    shown = set()
    astray = []
    for request in requests():
        fits = [r for r, p in routes.items() if r[0] == request.method and p.match(request.path)]
        shown.update(fits)
        if not fits:
            astray.append(f"{request.page}: {request.method} {request.path}")
        for route in fits:
            known = openapi["paths"][route[1]][route[0].lower()].get("parameters", [])
            names = {parameter["name"] for parameter in known if parameter["in"] == "query"}
            astray += [f"{request}: no {name}" for name, _ in request.query if name not in names]
    assert astray == []
    assert sorted(set(routes) - shown) == []


def test_every_metric() -> None:
    names = metric_names()
    assert len(names) > 15, "the search for metrics is broken"
    assert [name for name in names if not told(name)] == []


def test_every_command() -> None:
    names = list(commands(typer.main.get_command(command_line)))
    assert len(names) > 15, "the search for commands is broken"
    shown = {" ".join(words[:n]) for _, words in command_lines() for n in (1, 2)}
    assert [name for name in names if name not in shown] == []


def test_every_kind_of_problem() -> None:
    named = [kind.slug for kind in KINDS if kind.slug != "http"]
    assert [slug for slug in named if not told(f"`{slug}`")] == []


def test_every_finding_of_the_sensor_doctor() -> None:
    assert len(finding_names()) > 8, "the search for findings is broken"
    assert sorted(name for name in finding_names() if not told(f"`{name}`")) == []


@pytest.mark.parametrize(
    "checks", [RECOGNISED, WIDE_LOOP, JOINED, DOUBTED], ids=lambda c: c.section
)
def test_every_reason(checks: Checks) -> None:
    """Why a candidate waits, is rejected or is withdrawn: as it says, up to its figure."""
    page = " ".join((ROOT / "core" / "docs" / "concepts.md").read_text(encoding="utf-8").split())
    texts = [r.objection.replace("{0:.1%}", "|").split("|") for r in checks.rows if r.objection]
    reasons = [next(part.strip(" (),") for part in text if part) for text in texts]
    assert [reason for reason in reasons if reason not in page] == []


def test_the_parameters_of_the_tuning_guide_are_the_mapper_s() -> None:
    page = (ROOT / "service" / "docs" / "tuning.md").read_text(encoding="utf-8")
    told = re.findall(r"`([a-z]+)\.([a-z_]+)` \(([\d.]+)\)", page)
    assert len(told) > 8, "the search for parameters is broken"
    config = MapperConfig()
    real = [(part, name, str(getattr(getattr(config, part), name))) for part, name, _ in told]
    assert told == real
