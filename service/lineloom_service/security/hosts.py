"""Under which names the service is known, and which pages may have a browser change something.

Without tokens whoever reaches the service may use it, and a browser reaches what its user does. A
page from elsewhere may send requests there, and may even read the answers, if the name that it came
from is made to point here. What gives it away is that name in `Host`, or `Origin`.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Collection, Mapping
from functools import cached_property
from urllib.parse import urlsplit

from lineloom_service.errors import FOREIGN_ORIGIN, UNKNOWN_HOST, ProblemError

_OWN_ENDINGS = (".localhost", ".local", ".lan", ".internal", ".home.arpa")
"""Names below these are given by one's own network, and by nobody in the internet."""

_SAFE = ("GET", "HEAD", "OPTIONS")


class Hosts:
    """The names of one service. named: by its settings. origins: whose pages may call it."""

    def __init__(self, named: Collection[str], origins: Collection[str]) -> None:
        self._named = {name.lower() for name in named}
        self._origins = {origin.lower() for origin in origins}

    @cached_property
    def _machine(self) -> set[str]:
        name = socket.gethostname().lower()
        return {name, name.partition(".")[0]}

    def knows(self, host: str, server: str | None = None) -> bool:
        """Whether a `Host` cannot be a name that somebody elsewhere has made to point here.

        Addresses are no names, and names without a dot are given by one's own network. server: the
        address that the connection came in on.
        """
        name = _name_of(host)
        if name is None:
            return False
        if name in self._named or name == server or _is_address(name) or "." not in name:
            return True
        return name.endswith(_OWN_ENDINGS) or name in self._machine

    def check(self, method: str, headers: Mapping[str, str], server: str | None) -> None:
        """Raises ProblemError where nothing but names protects: 421 by `Host`, 403 by `Origin`."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self.knows(host, server):
            raise ProblemError(
                UNKNOWN_HOST,
                f"{host or 'no name'} is not known as a name of this service: LINELOOM_ALLOW_HOSTS "
                "names those that it has, or make a token, which protects it under any",
            )
        if method in _SAFE:
            return
        site = headers.get("sec-fetch-site", "none")
        foreign = origin is not None and origin.lower() not in self._origins | _origins_of(host)
        if foreign or (origin is None and site == "cross-site"):
            raise ProblemError(
                FOREIGN_ORIGIN,
                f"a page of {origin or 'elsewhere'} may change nothing here: "
                "LINELOOM_ALLOW_ORIGINS names those that may",
            )


def _origins_of(host: str) -> set[str]:
    return {f"http://{host.lower()}", f"https://{host.lower()}"}


def _name_of(host: str) -> str | None:
    """Return the name in a `Host`, without port and brackets; None where there is none."""
    try:
        name = urlsplit(f"//{host}").hostname
    except ValueError:
        return None
    return name.rstrip(".") if name else None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return False
    return True
