"""What the page says where there is no map: no site, no token, no service."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.viewer.conftest import Console
from tests.viewer.fake_server import TOKEN, FakeServer
from tests.viewer.fake_site import SITE
from tests.viewer.viewer_page import expect_components, open_viewer


def test_no_site_tells_how_to_send_a_first_scan_and_goes_on_by_itself(
    fake: FakeServer, page: Page
) -> None:
    fake.exists = False
    page.goto(fake.url)
    blank = page.locator("#blank")
    expect(blank.get_by_role("heading", name="No site yet")).to_be_visible()
    expect(blank.locator("pre")).to_contain_text("curl http://127.0.0.1")
    fake.exists = True
    expect_components(page, "c0", "c1")
    expect(blank).to_be_hidden()
    assert f"site={SITE}" in page.url


def test_a_token_is_asked_for_and_travels_in_a_header_alone(
    fake: FakeServer, page: Page, console: Console
) -> None:
    fake.wants_token = True
    addresses: list[str] = []
    page.on("request", lambda request: addresses.append(request.url))
    page.goto(f"{fake.url}/?site={SITE}")
    dialog = page.get_by_role("dialog", name="Access token")
    dialog.get_by_label("Token with").fill("wrong")
    dialog.get_by_role("button", name="Continue").click()
    dialog = page.get_by_role("dialog", name="Access token")
    expect(dialog).to_contain_text("no token was given, or it is not valid")
    dialog.get_by_label("Token with").fill(TOKEN)
    dialog.get_by_role("button", name="Continue").click()
    expect_components(page, "c0", "c1")
    page.reload()
    expect_components(page, "c0", "c1")
    assert [address for address in addresses if TOKEN in address] == []
    assert page.evaluate("() => localStorage.getItem('lineloom.token')") is None
    console.expect("401")


def test_the_page_finds_a_service_that_was_away(
    fake: FakeServer, page: Page, console: Console
) -> None:
    open_viewer(page, fake.url, SITE)
    status = page.locator("#status")
    expect(status).to_contain_text("Live")
    fake.stop()
    expect(status).to_contain_text("Service away")
    expect_components(page, "c0", "c1")  # what was there stays
    fake.site.join()
    fake.start()
    expect(status).to_contain_text("Live", timeout=30_000)
    expect_components(page, "c0")
    console.expect("ERR_CONNECTION_REFUSED")
    console.expect("ERR_INCOMPLETE_CHUNKED_ENCODING")
    console.expect("ERR_EMPTY_RESPONSE")
    console.expect("ERR_CONNECTION_RESET")


@pytest.mark.parametrize("streams", [True, False])
def test_changes_arrive_by_events_or_else_by_polling(
    fake: FakeServer, page: Page, console: Console, streams: bool
) -> None:
    fake.streams = streams
    open_viewer(page, fake.url, SITE)
    expect(page.locator("#status")).to_have_attribute(
        "data-connection", "live" if streams else "polling"
    )
    fake.site.join()
    expect_components(page, "c0")
    console.expect("404" if not streams else "nothing")
