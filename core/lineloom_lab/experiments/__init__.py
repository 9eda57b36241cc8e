"""The thesis's chapter 6, runnable: `lineloom experiment NAME` runs what is here.

Each experiment records scans in the simulator, lets the matchers answer side by side and returns
a `Report`: figures, a table, series for JSON, and what differs from the printed text and why.
Nothing in the core imports this package.
"""

from lineloom_lab.experiments.catalogue import (
    EXPERIMENTS,
    Experiment,
    UnknownExperimentError,
    experiment_named,
)
from lineloom_lab.experiments.report import MissingDataError, Report
from lineloom_lab.experiments.settings import MATCHER_CHOICES, Settings

__all__ = [
    "EXPERIMENTS",
    "MATCHER_CHOICES",
    "Experiment",
    "MissingDataError",
    "Report",
    "Settings",
    "UnknownExperimentError",
    "experiment_named",
]
