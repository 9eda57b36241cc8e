"""Settings, and that the README tells of every one."""

from __future__ import annotations

from pathlib import Path

import pytest
from lineloom_service.settings import Settings

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
