"""The requests that the docs' curl commands make."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import parse_qsl, urlsplit

from tests.docs.pages import shell_commands

_SERVICE = "localhost:8765"
_VARIABLES = {"$S": f"{_SERVICE}/v1/sites/floor-2", "$C": "id", "$E": "id"}
_WITH_VALUE = {"-H", "-d", "-o", "-X", "--data-binary"}
_ALONE = {"-s", "-sN"}


@dataclass(frozen=True, slots=True)
class Request:
    """query: names and values. body: as given, None where there is none."""

    page: str
    method: str
    path: str
    query: tuple[tuple[str, str], ...]
    body: str | None


def requests() -> list[Request]:
    """Every request to the service that a curl command of the docs makes."""
    return [_read(c.page, list(c.words[1:])) for c in shell_commands() if c.words[0] == "curl"]


def _read(page: str, words: list[str]) -> Request:
    options: dict[str, str] = {}
    urls: list[str] = []
    rest = iter(words)
    for word in rest:
        if word in _WITH_VALUE:
            options[word] = next(rest)
        elif word not in _ALONE:
            assert not word.startswith("-"), f"{page}: what does {word} of curl do?"
            urls.append(word)
    assert len(urls) == 1, f"{page}: {urls} is not one address"
    url = urls[0]
    for name, value in _VARIABLES.items():
        url = url.replace(name, value)
    assert url.startswith(_SERVICE), f"{page}: {url} is not the service of the other examples"
    body = options.get("-d", options.get("--data-binary"))
    parts = urlsplit(f"http://{url}")
    method = options.get("-X", "GET" if body is None else "POST")
    return Request(page, method, parts.path, tuple(parse_qsl(parts.query)), body)
