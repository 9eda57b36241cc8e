"""The mapper's parameters, of a site."""

from __future__ import annotations

from typing import Any

from pydantic import RootModel

from lineloom.wire.base import Answer
from lineloom.wire.site import Remaking


class ConfigChange(RootModel[dict[str, Any]]):
    """Parameters by name, nested, e.g. `{"join": {"least_set": 4}}`; which there are, GET tells."""


class ParameterValue(Answer):
    """A parameter as it holds now.

    unit: "" for a plain number; a share is from 0 to 1. least, most: what it can be, null for a
    word, which is one of `choices`.
    """

    value: int | float | str
    default: int | float | str
    unit: str
    meaning: str
    least: float | None
    most: float | None
    choices: list[str] | None = None


class SiteConfig(Answer):
    """What a site's map is made with.

    parameters: every one by its dotted name. own: those that the site's own PUT named, nested as
    they were sent. position: of the entry in the site's log that says so, null where it never
    was anything but the defaults. digest: of parameters, code and processor together. effect: what
    a PUT leads to. remaking: how far the map is that will be shown with them.
    """

    site: str
    parameters: dict[str, ParameterValue]
    own: dict[str, Any]
    position: int | None = None
    digest: str
    effect: str | None = None
    remaking: Remaking | None = None
