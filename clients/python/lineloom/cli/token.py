"""`lineloom token`: who may talk to the service. Works on the service's data, not over HTTP."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, Any

import typer

from lineloom.cli import options
from lineloom.cli.console import note as tell
from lineloom.cli.console import print_json
from lineloom.cli.failure import CommandError
from lineloom.cli.server_settings import server_settings

app = typer.Typer(
    no_args_is_help=True,
    help="""Make, list and revoke the bearer tokens of the service on this machine.

    Works on its data directory, or on LINELOOM_DATABASE_URL, whether it is running or not; a
    running service knows within two seconds. As soon as there has been one token, every call
    needs one.

    \b
    Example:
      lineloom token create --scope ingest --site floor-2 --robot robot-7
      lineloom token create --scope read --scope operate --note "operator's desk"
    """,
)

DataDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="The service's data; LINELOOM_DATA_DIR, else ./lineloom-data."
    ),
]


@app.command()
def create(
    scope: Annotated[
        list[str], typer.Option(metavar="SCOPE", help="ingest, read or operate; may be repeated.")
    ],
    site: Annotated[str | None, typer.Option(metavar="NAME", help="Bind it to this site.")] = None,
    robot: Annotated[
        str | None, typer.Option(metavar="NAME", help="And to this robot of it: ingest only.")
    ] = None,
    note: Annotated[str, typer.Option(metavar="TEXT", help="Who has it; shown by `list`.")] = "",
    data_dir: DataDir = None,
    json: options.Json = False,
) -> None:
    """Make a token and print it: now, and never again. The service keeps only a digest.

    \b
    Example:
      export LINELOOM_TOKEN=$(lineloom token create --scope read)
    """
    book, run = _open(data_dir)
    try:
        token, record = run(
            lambda connection: book.create_token(
                connection, scope, site=site, robot=robot, note=note
            )
        )
    except book.TokenRefusedError as error:
        raise CommandError(str(error)) from None
    if json:
        print_json({"token": token, **_told(record)})
        return
    tell(f"token {record.id} for {_good_for(record.scopes, record.site, record.robot)}:")
    print(token)


@app.command("list")
def list_(data_dir: DataDir = None, json: options.Json = False) -> None:
    """List the tokens: id, what they are good for, when they were made. Never the secrets.

    \b
    Example:
      lineloom token list
    """
    book, run = _open(data_dir)
    records = run(book.read_tokens)
    if json:
        print_json({"tokens": [_told(record) for record in records]})
        return
    for record in records:
        state = f"made {_day(record.created)}"
        if record.revoked is not None:
            state += f", revoked {_day(record.revoked)}"
        scopes = _good_for(record.scopes, record.site, record.robot)
        print("  ".join(part for part in (record.id, scopes, state, record.note) if part))
    if not records:
        tell("no tokens: the service listens to this machine only, and to everybody on it")


@app.command()
def revoke(
    token_id: Annotated[str, typer.Argument(metavar="ID", help="The id that `list` shows.")],
    data_dir: DataDir = None,
) -> None:
    """Make a token worthless for good.

    \b
    Example:
      lineloom token revoke 1f0c2a9b77de
    """
    book, run = _open(data_dir)
    if not run(lambda connection: book.revoke_token(connection, token_id)):
        raise CommandError(f"no token {token_id} that is still good; see `lineloom token list`")
    tell(f"token {token_id} is revoked")


def _open(data_dir: Path | None) -> tuple[Any, Callable[[Any], Any]]:
    """Return the module that knows the table, and what runs its functions on the database."""
    settings = server_settings(data_dir)
    from lineloom_service.security import token_book
    from lineloom_service.store.maintenance import run_beside
    from lineloom_service.store.records import StoreError

    def run(work: Callable[[Any], Any]) -> Any:
        try:
            return run_beside(settings, work)
        except StoreError as error:
            raise CommandError(str(error)) from None

    return token_book, run


def _told(record: Any) -> dict[str, Any]:
    """Return what may be known of a token, for scripts."""
    names = ("id", "scopes", "site", "robot", "note", "created", "revoked")
    return {name: getattr(record, name) for name in names}


def _good_for(scopes: tuple[str, ...], site: str | None, robot: str | None) -> str:
    where = "" if site is None else f" at {site}" + ("" if robot is None else f"/{robot}")
    return ", ".join(scopes) + where


def _day(stamp: float) -> str:
    return datetime.fromtimestamp(stamp, timezone.utc).strftime("%Y-%m-%d %H:%M")
