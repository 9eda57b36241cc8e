"""`lineloom events`: what happens to a site, as it happens."""

from __future__ import annotations

import json as json_text
from datetime import datetime
from typing import Annotated

import typer

from lineloom.cli import options
from lineloom.cli.patience import quick
from lineloom.client import Client
from lineloom.wire import AnyEvent


def events(
    follow: Annotated[
        bool, typer.Option("--follow", "-F", help="Go on with what happens, until Ctrl-C.")
    ] = False,
    after: Annotated[
        str | None, typer.Option(metavar="ID", help="Begin right after this event.")
    ] = None,
    type_: Annotated[
        list[str] | None,
        typer.Option("--type", metavar="TYPE", help="Only events of this type; may be repeated."),
    ] = None,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Print the events of a site, a line each; --json prints an object a line, with its id.

    Without --after it begins with what happens from now on: use --follow.

    \b
    Example:
      lineloom events --follow --type component-merged --type constraint --site floor-2
    """
    try:
        with Client(url, token=token, retry=quick()) as client:
            for event in client.events(site, last_event_id=after, until_now=not follow):
                if not type_ or event.type in type_:
                    # Flushed: who pipes this waits for it.
                    print(_json(event) if json else line_of(event), flush=True)
    except KeyboardInterrupt:
        raise typer.Exit from None


def line_of(event: AnyEvent) -> str:
    """Return an event for people, on one line."""
    at = datetime.fromtimestamp(event.at).strftime("%H:%M:%S")
    return f"{at} {event.type:18}{_said(event)}"


def _said(event: AnyEvent) -> str:
    if event.type == "scan":
        return f"{event.robot}: {event.added} more, {event.processed} in the map"
    if event.type == "robot":
        if event.forgotten:
            return f"{event.robot} was forgotten"
        return f"{event.robot}: {event.state}" + "".join(f"; {text}" for text in event.health)
    if event.type == "component-merged":
        return f"{event.component} joined {event.merged_into}: {', '.join(event.robots)}"
    if event.type == "component-split":
        return f"{event.component} left {event.split_from}: {', '.join(event.robots)}"
    if event.type == "constraint":
        return f"{event.constraint}: {event.kind}, {event.state}: {event.reason}"
    if event.type == "map":
        count = f"{len(event.changed)} lines changed, {len(event.removed)} removed"
        return (count if event.complete else "too many lines changed to list") + (
            ", settled" if event.settled else ""
        )
    if event.type == "remade":
        return f"made anew: {event.why}"
    return f"load all anew: {event.reason}"


def _json(event: AnyEvent) -> str:
    return json_text.dumps(event.model_dump(mode="json") | {"id": event.id})
