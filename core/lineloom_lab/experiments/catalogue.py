"""The experiments by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lineloom_lab.experiments.error_area_experiment import run_error_area
from lineloom_lab.experiments.path_experiment import run_closed_path, run_sparse_path
from lineloom_lab.experiments.real_scans_experiment import run_real_scans
from lineloom_lab.experiments.report import Report
from lineloom_lab.experiments.settings import Settings
from lineloom_lab.experiments.straight_run_experiment import run_straight_run
from lineloom_lab.experiments.timing_experiment import run_timing


class UnknownExperimentError(ValueError):
    """There is no experiment of that name."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment of chapter 6. name: on the command line. about: one line. run: does it."""

    name: str
    about: str
    run: Callable[[Settings], Report]


EXPERIMENTS: tuple[Experiment, ...] = (
    Experiment("closed-path", "14 m x 7 m map and errors from 3069 scans (§6.2)", run_closed_path),
    Experiment("sparse-path", "the same path from 23 scans (§6.2)", run_sparse_path),
    Experiment("error-area", "injected pose error and error area (§6.3.1)", run_error_area),
    Experiment("straight-run", "displacement and error area on 18.65 m (§6.3.2)", run_straight_run),
    Experiment("real-scans", "a map from real scans (§6.4)", run_real_scans),
    Experiment("timing", "time per pair beside the printed 3.48 ms (§6.2)", run_timing),
)


def experiment_named(name: str) -> Experiment:
    """Return an experiment; raises UnknownExperimentError that lists the names."""
    for experiment in EXPERIMENTS:
        if experiment.name == name:
            return experiment
    names = ", ".join(e.name for e in EXPERIMENTS)
    raise UnknownExperimentError(f"no experiment {name!r}; there are {names}")
