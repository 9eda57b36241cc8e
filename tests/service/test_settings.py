"""Settings, and that the README tells of every one."""

from __future__ import annotations

from pathlib import Path

import pytest
from lineloom.cli.app import app
from lineloom_service.settings import Settings
from typer.testing import CliRunner

README = Path(__file__).parents[2] / "service" / "README.md"


def test_every_setting_is_in_the_readme() -> None:
    text = README.read_text()
    missing = [name for name in Settings.model_fields if f"LINELOOM_{name.upper()}`" not in text]
    assert missing == []


def test_the_environment_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINELOOM_PORT", "9999")
    monkeypatch.setenv("LINELOOM_GAP_WINDOW_S", "0.5")
    settings = Settings()
    assert (settings.port, settings.gap_window_s) == (9999, 0.5)
    assert Settings(port=1).port == 1


def test_nonsense_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINELOOM_WORKERS", "0")
    with pytest.raises(ValueError, match="workers"):
        Settings()


def test_a_file_of_parameters_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "mapper.toml"
    file.write_text("chapter = 64\n[join]\nleast_set = 4\n", encoding="utf-8")
    monkeypatch.setenv("LINELOOM_MAPPER_CONFIG", str(file))
    mapper = Settings().mapper
    assert (mapper.chapter, mapper.join.least_set, mapper.join.distinctive) == (64, 4, 1.3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[join]\nleast_sett = 4\n", "join.least_sett: is not a parameter"),
        ("[join]\nleast_set = 0\n", "join.least_set: has to be from 1"),
        ("join =", "is not TOML"),
        (None, "there is no such file"),
    ],
)
def test_a_bad_file_of_parameters_stops_the_start(
    tmp_path: Path, text: str | None, said: str
) -> None:
    file = tmp_path / "mapper.toml"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    done = CliRunner().invoke(app, ["serve", "--mapper-config", str(file)])
    assert done.exit_code != 0
    assert f"{file}: " in done.stderr
    assert said in done.stderr
