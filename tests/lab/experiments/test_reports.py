"""Every experiment's report says what it must, the same way each time."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import pytest
from lineloom_lab.experiments import (
    EXPERIMENTS,
    MissingDataError,
    Report,
    Settings,
    UnknownExperimentError,
    experiment_named,
)
from lineloom_lab.experiments.report import Row

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
NAMES = [e.name for e in EXPERIMENTS if e.name != "real-scans"]


def quick(name: str, seed: int = 0) -> Report:
    return experiment_named(name).run(Settings(seed=seed, quick=True))


def test_these_are_the_experiments() -> None:
    names = ["closed-path", "sparse-path", "error-area", "straight-run", "real-scans", "timing"]
    assert [e.name for e in EXPERIMENTS] == names
    with pytest.raises(UnknownExperimentError, match="closed-path, sparse-path"):
        experiment_named("closed")
    with pytest.raises(ValueError, match="default, thesis, both"):
        Settings(matcher="none")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NAMES)
def test_a_report_is_whole(name: str, tmp_path: Path) -> None:
    report = quick(name)
    paths = report.save(tmp_path)
    text = (tmp_path / f"{name}.md").read_text(encoding="utf-8")
    data = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
    for said in ("thesis's matcher", "default matcher", "printed in the thesis", "differs", "§6."):
        assert said in text
    assert report.differences
    assert set(data["matchers"]) == {"thesis", "default"}
    assert len(paths) == 2 + 2 * len(report.figures)
    for path in paths:
        if path.suffix == ".svg":
            assert len(list(ElementTree.parse(path).getroot().iter())) > 12
        if path.suffix == ".png":
            assert path.read_bytes()[:4] == b"\x89PNG"


def test_the_sparse_path_prints_the_sizes_of_the_text() -> None:
    report = quick("sparse-path")
    assert report.parameters["scans"] == 23
    assert report.parameters["path_m"] == pytest.approx(43.19)
    assert report.figures_of["default"]["right"] == report.figures_of["default"]["pairs"] == 22
    assert report.figures_of["thesis"]["right"] >= 11
    wrong = 22 - int(report.figures_of["thesis"]["right"])
    assert "right, 2 seeds, least to most" in report.to_markdown()
    assert f"gets {wrong} of 22 pairs wrong" in report.to_markdown()


def test_the_timing_stands_beside_3_48_ms() -> None:
    assert "3.48 ms" in quick("timing").to_markdown()


def test_the_same_seed_gives_the_same_report() -> None:
    a, b, c = (json.dumps(quick("sparse-path", seed).to_json()) for seed in (4, 4, 5))
    assert a == b
    assert a != c


def test_one_matcher_alone() -> None:
    report = experiment_named("sparse-path").run(Settings(quick=True, matcher="default"))
    assert report.matchers == ("default matcher",)
    assert "thesis" not in report.figures_of


def test_what_is_not_a_number_becomes_null() -> None:
    row = Row("what", "", ("1",))
    report = Report("n", "t", "§6", (), ("m",), (row,), (), (), series={"m": {"x": [1, math.nan]}})
    assert report.to_json()["series"] == {"m": {"x": [1, None]}}
    assert report.to_json()["table"] == [{"what": "what", "printed": None, "m": "1"}]


def test_without_real_data_the_experiment_says_so(tmp_path: Path) -> None:
    for data in (None, tmp_path):
        with pytest.raises(MissingDataError, match="real-scans"):
            experiment_named("real-scans").run(Settings(quick=True, data=data))


def test_real_scans() -> None:
    if not (SHARED / "fr079").is_dir():
        pytest.skip(f"{SHARED / 'fr079'} is absent")
    report = experiment_named("real-scans").run(Settings(quick=True, data=SHARED))
    found = report.figures_of["default"]
    assert found["right"] == found["pairs"] == 29
    assert math.hypot(found["end_x"], found["end_y"]) < 0.2
    assert "7.84 cm" in report.to_markdown()
