"""Calls about the mapper's parameters of a site."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from lineloom.calls import Call, Name, read_model, site_path
from lineloom.wire import JSON, RemadeEvent, SiteConfig


def config(site: Name) -> Call[SiteConfig]:
    """GET the parameters."""
    return Call("GET", f"{site_path(site)}/config", read_model(SiteConfig))


def put_config(site: Name, parameters: Mapping[str, Any]) -> Call[SiteConfig]:
    """PUT those that the site names itself."""
    return Call(
        "PUT",
        f"{site_path(site)}/config",
        read_model(SiteConfig),
        headers={"Content-Type": JSON},
        content=json.dumps(parameters).encode(),
    )


def difference(site: Name) -> Call[RemadeEvent]:
    """GET what changed when the map was last made anew."""
    return Call("GET", f"{site_path(site)}/config/difference", read_model(RemadeEvent))
