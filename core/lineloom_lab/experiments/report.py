"""What an experiment found: figures, a table, series, and what differs from the printed text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lineloom_lab.experiments.figure import Figure


class MissingDataError(Exception):
    """The data that an experiment reads is not there; the message says where it was sought."""


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table: what, what the text prints ("" = no number), and one cell a matcher."""

    what: str
    printed: str
    cells: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Report:
    """The outcome of one experiment.

    name: as on the command line. sections: of the thesis. setup: sentences on what was done.
    matchers: the table's columns after "thesis, printed". figures_of: per matcher key its figures,
    in SI units and radians. series: per matcher key its curves by name. differences: what differs
    from the printed figures, and why.
    """

    name: str
    title: str
    sections: str
    setup: tuple[str, ...]
    matchers: tuple[str, ...]
    rows: tuple[Row, ...]
    figures: tuple[Figure, ...]
    differences: tuple[str, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    figures_of: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    series: Mapping[str, Mapping[str, Sequence[float]]] = field(default_factory=dict)

    def to_markdown(self) -> str:
        """Return the report for people."""
        header = ["", "printed in the thesis", *self.matchers]
        lines = [header, *([r.what, r.printed or "–", *r.cells] for r in self.rows)]
        widths = [max(3, *(len(line[k]) for line in lines)) for k in range(len(header))]
        rows = [_table_line(line, widths) for line in lines]
        rows.insert(1, "| " + " | ".join("-" * w for w in widths) + " |")
        parts = [
            f"# {self.title} (thesis {self.sections})",
            "\n".join(self.setup),
            "\n".join(rows),
            "## What differs from the printed figures, and why\n\n"
            + "\n".join(f"- {text}" for text in self.differences),
        ]
        if self.figures:
            named = "\n".join(f"- {f.title}: `{f.name}.svg`, `{f.name}.png`" for f in self.figures)
            parts.append(f"## Figures\n\n{named}")
        return "\n\n".join(parts) + "\n"

    def to_json(self) -> dict[str, Any]:
        """Return everything but the drawings, for scripts; NaN becomes null."""
        plain: dict[str, Any] = _plain(
            {
                "experiment": self.name,
                "title": self.title,
                "sections": self.sections,
                "setup": list(self.setup),
                "parameters": self.parameters,
                "table": [
                    {
                        "what": r.what,
                        "printed": r.printed or None,
                        **dict(zip(self.matchers, r.cells, strict=True)),
                    }
                    for r in self.rows
                ],
                "matchers": self.figures_of,
                "series": self.series,
                "differences": list(self.differences),
                "figures": [f.name for f in self.figures],
            }
        )
        return plain

    def save(self, folder: Path) -> tuple[Path, ...]:
        """Write `name`.md, `name`.json and all figures into a folder, made if need be."""
        folder.mkdir(parents=True, exist_ok=True)
        text, data = folder / f"{self.name}.md", folder / f"{self.name}.json"
        text.write_text(self.to_markdown(), encoding="utf-8")
        data.write_text(json.dumps(self.to_json(), indent=1) + "\n", encoding="utf-8")
        drawn = [path for figure in self.figures for path in figure.save(folder)]
        return (text, data, *drawn)


def _table_line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "| " + " | ".join(c.ljust(w) for c, w in zip(cells, widths, strict=True)) + " |"


def _plain(value: Any) -> Any:
    """Return a value of JSON's own kinds; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (str, bool, int)) or value is None:
        return value
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    number = float(value)
    return round(number, 9) if math.isfinite(number) else None
