"""`lineloom db`: the service's database, kept, moved, looked through. Works on the data itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, TypeVar

import typer

from lineloom.cli import options
from lineloom.cli.console import note as tell
from lineloom.cli.console import print_json
from lineloom.cli.failure import CommandError, Exit
from lineloom.cli.server_settings import server_settings

T = TypeVar("T")

app = typer.Typer(
    no_args_is_help=True,
    help="""Back up, restore, check and salvage the database of the service on this machine.

    Works on its data directory, or on LINELOOM_DATABASE_URL. A copy is one file, from either
    kind of database, and can be restored to either.

    \b
    Example:
      lineloom db backup /backup/lineloom.db
      lineloom db check
    """,
)

DataDir = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="The service's data; LINELOOM_DATA_DIR, else ./lineloom-data."
    ),
]
NewFile = Annotated[Path, typer.Argument(metavar="FILE", help="The file to write; a new one.")]


@app.command()
def backup(file: NewFile, data_dir: DataDir = None) -> None:
    """Write all there is into a file, as it is at one moment, while the service goes on.

    \b
    Example:
      lineloom db backup /backup/lineloom.db
    """
    keeping, settings = _open(data_dir)
    rows = _said(lambda: keeping.back_up(settings, file))
    tell(f"{rows} rows are in {file}")


@app.command()
def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `backup` wrote.")],
    data_dir: DataDir = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Although there are sites; they are put aside.")
    ] = False,
) -> None:
    """Put a copy in the place of the database. The service has to be stopped.

    What was deleted since the copy was made stays deleted. A file that is replaced is kept beside
    it; what PostgreSQL has is not.

    \b
    Example:
      lineloom db restore /backup/lineloom.db --replace
    """
    keeping, settings = _open(data_dir)
    kept = _said(lambda: keeping.restore(settings, file, replace=replace))
    tell(f"{file} is restored" + ("" if kept is None else f"; what was there is {kept}"))


@app.command()
def check(data_dir: DataDir = None, json: options.Json = False) -> None:
    """Read every row and compare it with its checksum; exit with 4 where something is damaged.

    \b
    Example:
      lineloom db check
    """
    keeping, settings = _open(data_dir)
    found = _said(lambda: keeping.inspect(settings))
    if json:
        names = ("entries", "unchecked", "damage")
        print_json({name: getattr(found, name) for name in names})
    else:
        for line in found.damage:
            print(line)
        older = f", {found.unchecked} from before there were checksums" if found.unchecked else ""
        tell(f"{found.entries} log entries{older}; {len(found.damage) or 'no'} damaged")
    if found.damage:
        raise typer.Exit(int(Exit.NEGATIVE))


@app.command()
def salvage(file: NewFile, data_dir: DataDir = None) -> None:
    """Write all of the log that is whole into a file, to be restored; maps are made anew from it.

    \b
    Example:
      lineloom db salvage saved.db
    """
    keeping, settings = _open(data_dir)
    lost: list[str] = []
    rows = _said(lambda: keeping.save_what_can_be_read(settings, file, lost.append))
    for line in lost:
        print(line)
    tell(f"{rows} rows are in {file}; {len(lost) or 'none'} could not be read")


def _open(data_dir: Path | None) -> tuple[ModuleType, Any]:
    """Return the module that does it, and the settings that say where."""
    settings = server_settings(data_dir)
    from lineloom_service.store import keeping

    return keeping, settings


def _said(work: Callable[[], T]) -> T:
    from lineloom_service.store.records import StoreError

    try:
        return work()
    except StoreError as error:
        raise CommandError(str(error)) from None
