"""`lineloom config`: the mapper's parameters of a site."""

from __future__ import annotations

import json as json_text
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from lineloom.cli import options
from lineloom.cli.console import note, out, print_json
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.patience import quick
from lineloom.client import Client
from lineloom.wire import SiteConfig

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def config() -> None:
    """Say and change what a site's map is made with.

    Other parameters make the map anew from its first scan, beside the one that is shown, which is
    shown until the new one is as far.

    \b
    Example:
      lineloom config set join.least_evidence=80 --site floor-2
      lineloom config difference --site floor-2
    """


@app.command("show")
def show(
    every: Annotated[
        bool, typer.Option("--all", help="All parameters, and not only those that differ.")
    ] = False,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say which parameters are not the defaults; with --all what each of them means.

    \b
    Example:
      lineloom config show --all --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        found = client.config(site)
    if json:
        print_json(found.model_dump(mode="json"))
        return
    _print(found, every=every)


@app.command("set")
def set_(
    changes: Annotated[
        list[str],
        typer.Argument(metavar="NAME=VALUE…", help="E.g. join.least_set=4 matcher=thesis."),
    ],
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Set parameters of a site, beside those that were set; NAME= takes one back.

    \b
    Example:
      lineloom config set join.least_evidence=80 tracker.patience= --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        own = client.config(site).own if any(s.site == site for s in client.sites().sites) else {}
        for change in changes:
            _apply(own, change)
        found = client.set_config(site, own)
    _report(found, json=json)


@app.command("file")
def file(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="TOML: a table for each part, as for `serve`.")
    ],
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Set the parameters of a file, in place of all that were set; an empty one sets none.

    \b
    Example:
      lineloom config file mapper.toml --site floor-2
    """
    try:
        parameters = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CommandError(f"{path}: is not TOML: {error}", Exit.USAGE) from None
    with Client(url, token=token, retry=quick()) as client:
        found = client.set_config(site, parameters)
    _report(found, json=json)


@app.command("difference")
def difference(
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say what changed when the map was last made anew.

    \b
    Example:
      lineloom config difference --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        found = client.config_difference(site)
    if json:
        print_json(found.model_dump(mode="json"))
        return
    out.print(f"made anew at version {found.version}: {found.why}", markup=False)
    for when, components in (("was", found.components_before), ("is", found.components_after)):
        for component in components:
            out.print(f"{when} {component.id}: {', '.join(component.robots)}", markup=False)
    for what, names in (("gained", found.constraints_gained), ("lost", found.constraints_lost)):
        if names:
            out.print(f"{what} {len(names)} constraints: {' '.join(names[:10])}", markup=False)
    for robot in found.robots:
        if robot.moved_m is not None:
            out.print(f"{robot.robot} moved by {robot.moved_m:.3f} m", markup=False)
    out.print(f"{found.lines_changed} lines changed, {found.lines_removed} removed", markup=False)


def _apply(own: dict[str, Any], change: str) -> None:
    name, equals, text = change.partition("=")
    if not equals or not name:
        raise CommandError(f"{change!r}: write NAME=VALUE", Exit.USAGE)
    *above, last = name.split(".")
    table = own
    for part in above:
        table = table.setdefault(part, {})
        if not isinstance(table, dict):
            raise CommandError(f"{name}: {part} is a value, and holds none", Exit.USAGE)
    if not text:
        table.pop(last, None)
        return
    try:
        table[last] = json_text.loads(text)
    except ValueError:
        table[last] = text  # a word: the service knows where there is one, and which


def _report(found: SiteConfig, *, json: bool) -> None:
    if json:
        print_json(found.model_dump(mode="json"))
        return
    _print(found, every=False)
    note(f"effect: {found.effect}")


def _print(found: SiteConfig, *, every: bool) -> None:
    for name, p in found.parameters.items():
        if every or p.value != p.default:
            usual = "" if p.value == p.default else f" ({_shown(p.default)})"
            value = f"{name} = {_shown(p.value)}{usual} {p.unit}".rstrip()
            out.print(f"{value}: {p.meaning}", markup=False, soft_wrap=True)


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"
