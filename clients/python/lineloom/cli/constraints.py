"""`lineloom constraints`: what ties places together, why, and how to undo it."""

from __future__ import annotations

import itertools
import math
from typing import Annotated

import typer
from rich.table import Table

from lineloom.cli import options
from lineloom.cli.complete import robot_names
from lineloom.cli.console import out, print_json
from lineloom.cli.deliver import deliver
from lineloom.cli.patience import quick
from lineloom.cli.word import Word
from lineloom.client import Client
from lineloom.wire import Constraint, ConstraintDetail, WhatIf

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

Id = Annotated[str, typer.Argument(metavar="ID", help="Which constraint, as the list has it.")]


class Kind(Word):
    """What a constraint ties."""

    SEQUENTIAL = "sequential"
    LOOP = "loop"
    RENDEZVOUS = "rendezvous"
    OPERATOR = "operator"


class State(Word):
    """What is thought of it."""

    CANDIDATE = "candidate"
    ACCEPTED = "accepted"
    REJECTED = "rejected"
    RETRACTED = "retracted"


@app.callback()
def constraints() -> None:
    """List the edges of the pose graph, explain them, and undo or restore them.

    \b
    Example:
      lineloom constraints list --kind rendezvous --state accepted --site floor-2
      lineloom constraints retract k-4hqxw2oklm3dv7ye --site floor-2
    """


@app.command("list")
def list_(
    kind: Annotated[Kind | None, typer.Option(help="Only of this kind.")] = None,
    state: Annotated[State | None, typer.Option(help="Only in this state.")] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Only of this robot.", autocompletion=robot_names),
    ] = None,
    limit: Annotated[int, typer.Option(min=1, metavar="N", help="Show at most so many.")] = 50,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """List constraints, each with the reason for its state.

    \b
    Example:
      lineloom constraints list --kind rendezvous --site floor-2
    """
    wanted_kind = None if kind is None else kind.value
    wanted_state = None if state is None else state.value
    with Client(url, token=token, retry=quick()) as client:
        every = client.constraints(site, kind=wanted_kind, state=wanted_state)
        fitting = (c for c in every if robot in (None, c.robot_a, c.robot_b))
        found = list(itertools.islice(fitting, limit + 1))
    shown = found[:limit]
    if json:
        print_json([c.model_dump(mode="json") for c in shown])
        return
    table = Table("id", "kind", "state", "robots", "reason", box=None)
    for c in shown:
        table.add_row(c.id, c.kind, c.state, _robots(c), c.reason)
    out.print(table)
    if len(found) > limit:
        out.print(f"and more: these are the first {limit}; see --limit", markup=False)


@app.command("show")
def show(
    constraint: Id,
    svg: Annotated[
        bool, typer.Option("--svg", help="A drawing of the evidence instead of words.")
    ] = False,
    output: options.Output = None,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Explain a constraint: every check, its figure, and what it is held to.

    \b
    Example:
      lineloom constraints show k-4hqxw2oklm3dv7ye --site floor-2
      lineloom constraints show k-4hqxw2oklm3dv7ye --svg --output evidence.svg
    """
    with Client(url, token=token, retry=quick()) as client:
        if svg:
            deliver(client.constraint_svg(site, constraint).encode(), output)
            return
        found = client.constraint(site, constraint)
    if json:
        print_json(found.model_dump(mode="json"))
    else:
        _explain(found)


@app.command("retract")
def retract(
    constraint: Id,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Make the map as if a constraint had never been accepted; `restore` takes it back.

    \b
    Example:
      lineloom constraints retract k-4hqxw2oklm3dv7ye --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        _report(client.retract(site, constraint), json=json)


@app.command("restore")
def restore(
    constraint: Id,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Take a retraction back, or overrule what the mapper has withdrawn.

    \b
    Example:
      lineloom constraints restore k-4hqxw2oklm3dv7ye --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        _report(client.restore(site, constraint), json=json)


@app.command("confirm")
def confirm(
    constraint: Id,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Believe a candidate, or one that was rejected, although the evidence alone is not enough.

    \b
    Example:
      lineloom constraints confirm k-4hqxw2oklm3dv7ye --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        _report(client.confirm(site, constraint), json=json)


@app.command("what-if")
def what_if(
    constraint: Id,
    site: options.Site = options.DEFAULT_SITE,
    url: options.Url = None,
    token: options.Token = None,
    json: options.Json = False,
) -> None:
    """Say what retracting a constraint (restoring, where it is retracted) would do; do nothing.

    \b
    Example:
      lineloom constraints what-if k-4hqxw2oklm3dv7ye --site floor-2
    """
    with Client(url, token=token, retry=quick()) as client:
        answer = client.what_if(site, constraint)
    if json:
        print_json(answer.model_dump(mode="json"))
    else:
        _foretell(answer)


def _robots(c: Constraint) -> str:
    return " + ".join(dict.fromkeys(r for r in (c.robot_a, c.robot_b) if r))


def _report(c: Constraint, *, json: bool) -> None:
    if json:
        print_json(c.model_dump(mode="json"))
    else:
        out.print(f"{c.id}: {c.state}: {c.reason}", markup=False, soft_wrap=True)


def _explain(c: ConstraintDetail) -> None:
    pose = c.T_a_b
    out.print(f"{c.id}: {c.kind} of {_robots(c)}, {c.state}", markup=False)
    out.print(f"because {c.reason}", markup=False, soft_wrap=True)
    out.print(
        f"b in a: x {pose.x:.3f} m, y {pose.y:.3f} m, theta {math.degrees(pose.theta):.2f} deg"
    )
    table = Table("check", "figure", "held to", "holds", "means", box=None)
    for name, figure in c.checks.items():
        limit = (c.limits or {}).get(name)
        value = "" if figure is None else f"{figure:.3g}"
        if limit is None:
            table.add_row(name, value, "", "", "")
            continue
        bounds = [
            f"{sign} {bound:g}"
            for sign, bound in ((">=", limit.at_least), ("<=", limit.at_most))
            if bound is not None
        ]
        holds = ("yes" if limit.holds else "NO") if bounds else ""
        table.add_row(name, f"{value} {limit.unit}".strip(), " ".join(bounds), holds, limit.means)
    out.print(table)
    for change in c.history:
        line = f"version {change.version}: {change.state}: {change.reason}"
        out.print(line, markup=False, soft_wrap=True)


def _foretell(answer: WhatIf) -> None:
    for when, components in (
        ("now", answer.components_before),
        (f"after {answer.action}", answer.components_after),
    ):
        for component in components:
            out.print(f"{when}: {component.id}: {', '.join(component.robots)}", markup=False)
    for move in answer.robots:
        if move.moved_m is None:
            out.print(f"{move.robot} would be in another component", markup=False)
        elif move.moved_m > 0.0:
            turned = math.degrees(move.turned_rad or 0.0)
            out.print(f"{move.robot} would move by {move.moved_m:.3f} m, {turned:.2f} deg")
