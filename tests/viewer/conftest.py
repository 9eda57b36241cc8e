"""A real browser, started once, and a page that minds every error it meets."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import (
    Browser,
    BrowserContext,
    ConsoleMessage,
    Page,
    expect,
    sync_playwright,
)

from tests.viewer.fake_server import FakeServer, fake_server

CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
DESKTOP = {"width": 1280, "height": 800}
PATIENCE_MS = 30_000
"""A busy machine takes its time; what is there already is not waited for."""


def chromium_path() -> str:
    """Path of the system's Chromium, or a skip that says what to install."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no Chromium to test the viewer in: on Debian, apt-get install chromium")
    return path


# Not for the whole session: while Playwright runs, no asyncio loop can run beside it.
@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    path = chromium_path()
    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


class Console:
    """What the page complains of. Expected complaints are taken out by those who cause them."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        self._expected: list[str] = []

    def listen(self, page: Page) -> None:
        """Note uncaught exceptions and errors in the console."""
        page.on("pageerror", lambda error: self.errors.append(f"uncaught: {error}"))
        page.on("console", self._note)

    def _note(self, message: ConsoleMessage) -> None:
        if message.type == "error" and all(part not in message.text for part in self._expected):
            self.errors.append(message.text)

    def expect(self, part: str) -> None:
        """Take out complaints with these words, those included that are still on their way."""
        self._expected.append(part)
        self.errors = [error for error in self.errors if part not in error]


@pytest.fixture
def console() -> Iterator[Console]:
    console = Console()
    yield console
    assert console.errors == []


@pytest.fixture
def new_page(browser: Browser, console: Console) -> Iterator[Callable[..., Page]]:
    """Return a maker of pages, each in a context of its own."""
    contexts: list[BrowserContext] = []

    def make(**options: object) -> Page:
        context = browser.new_context(**{"viewport": DESKTOP, **options})  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        console.listen(page)
        return page

    yield make
    for context in contexts:
        context.close()


@pytest.fixture
def page(new_page: Callable[..., Page]) -> Page:
    return new_page()


@pytest.fixture
def fake() -> Iterator[FakeServer]:
    with fake_server() as server:
        yield server
