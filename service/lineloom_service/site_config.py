"""Which parameters a site's map is made with, and who says so.

A parameter has the value that the site's own PUT names, else that of the service's file, else the
default. What comes out of that is logged whenever it changes, or the code does.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Mapping
from typing import Any

from lineloom_core.mapping.config import MapperConfig, config_from
from lineloom_core.mapping.digest import digest
from lineloom_core.parameters import ParameterError, values

from lineloom_service.store.config_entry import ConfigEntry
from lineloom_service.store.feed_order import parted
from lineloom_service.store.records import SiteRecord

_LOG = logging.getLogger(__name__)


def ordered(own: Mapping[str, Any], base: MapperConfig) -> ConfigEntry:
    """Return what is logged for a site that names these, nested. Raises ParameterError."""
    config = config_from(own, base)
    return ConfigEntry(digest(config), values(config), dict(own))


def in_force(site: SiteRecord, base: MapperConfig) -> MapperConfig:
    """Return the parameters that a site's map is made with."""
    if site.config is None:
        return base
    try:
        return config_from(site.config.parameters)
    except ParameterError:  # other code logged them, and this one is about to
        return config_from(_known(site.name, site.config.own, base), base)


def first_config(base: MapperConfig) -> ConfigEntry | None:
    """Return what the log of a new site begins with; nothing where all are the defaults."""
    return None if base == MapperConfig() else ordered({}, base)


def to_order(site: SiteRecord, base: MapperConfig, told: str | None) -> ConfigEntry | None:
    """Return what has to be logged at the start, None where nothing has changed.

    told: what the map was made with that was told of last (`Making.id`).
    """
    own = {} if site.config is None else _known(site.name, site.config.own, base)
    order = ordered(own, base)
    if site.config is not None:
        same = site.config.digest == order.digest
    elif told is None:
        same = base == MapperConfig()
    else:
        same = parted(told)[0] == f"{order.digest}@0"
    return None if same else order


def _known(site: str, own: Mapping[str, Any], base: MapperConfig) -> dict[str, Any]:
    """Leave out what this code does not know any more, or no longer takes."""
    left: dict[str, Any] = copy.deepcopy(dict(own))
    while True:
        try:
            config_from(left, base)
        except ParameterError as error:
            _LOG.warning("site %s: of its own parameters is left out: %s", site, error)
            for name in error.wrong:
                _remove(left, name)
        else:
            return left


def _remove(tree: dict[str, Any], name: str) -> None:
    part, _, rest = name.partition(".")
    if rest and isinstance(tree.get(part), dict):
        _remove(tree[part], rest)
    elif part in tree:
        del tree[part]
    else:  # a name with a dot in it, which no PUT has taken
        tree.clear()
