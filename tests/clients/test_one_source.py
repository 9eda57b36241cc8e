"""The synchronous client is the asynchronous one, waiting in its thread."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from lineloom.calls import site_path, url_name

SOURCE = Path(__file__).parents[2] / "clients" / "python" / "one_source.py"


@pytest.fixture(scope="module")
def one_source() -> ModuleType:
    spec = importlib.util.spec_from_file_location("one_source", SOURCE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_synchronous_client_is_made_of_the_asynchronous_one(one_source: ModuleType) -> None:
    for source, made in one_source.MODULES.items():
        text = (one_source.PACKAGE / source).read_text(encoding="utf-8")
        found = (one_source.PACKAGE / made).read_text(encoding="utf-8")
        assert found == one_source.synchronous(text), "run python clients/python/one_source.py"


def test_a_name_may_be_a_number() -> None:
    assert site_path(7) == site_path("7") == "/v1/sites/7"
    assert url_name("a/b") == "a%2Fb"
    with pytest.raises(TypeError):
        url_name(7.5)  # type: ignore[arg-type]
