"""Where the service is."""

from __future__ import annotations

import ipaddress
import os

import httpx

DEFAULT_URL = "http://127.0.0.1:8765"
URL_VARIABLE = "LINELOOM_URL"
TOKEN_VARIABLE = "LINELOOM_TOKEN"


def service_url(url: str | None = None) -> str:
    """Return `url`, else LINELOOM_URL, else the embedded service's own address."""
    return (url or os.environ.get(URL_VARIABLE) or DEFAULT_URL).rstrip("/")


def service_token(token: str | None = None) -> str | None:
    """Return `token`, else LINELOOM_TOKEN, else None."""
    return token or os.environ.get(TOKEN_VARIABLE) or None


def is_loopback(url: str) -> bool:
    """Tell whether the service runs on this very machine."""
    host = httpx.URL(url).host
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
