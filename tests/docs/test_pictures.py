"""The concepts page's pictures can be made anew, and still show what the page says of them."""

from __future__ import annotations

import re

import pytest
from lineloom_core.io.drawing import Drawing
from lineloom_core.io.png import to_png

from tests.docs.pages import ROOT
from tests.docs.pictures import FOLDER, pictures

MOST_BYTES = 120_000


@pytest.fixture(scope="module")
def made() -> dict[str, Drawing]:
    return pictures()


def test_every_picture_is_there_small_and_shown(made: dict[str, Drawing]) -> None:
    page = (ROOT / "core" / "docs" / "concepts.md").read_text(encoding="utf-8")
    shown = re.findall(r"\]\(images/(\w+\.png)\)", page)
    assert sorted(set(shown) - {"office.png"}) == sorted(made)
    for name, drawing in made.items():
        assert 1_000 < (FOLDER / name).stat().st_size < MOST_BYTES
        assert to_png(drawing).startswith(b"\x89PNG")


def test_they_show_what_the_page_says(made: dict[str, Drawing]) -> None:
    assert "2 components" in made["before.png"].title
    assert "1 component" in made["after.png"].title
    assert "2 components" in made["undone.png"].title
    waiting, undone = made["waiting.png"].description, made["constraints.png"].description
    assert re.search(r"[1-9]\d* candidate", waiting)
    assert "0 accepted" in waiting
    assert re.search(r"[1-9]\d* rejected, 1 retracted", undone)
