"""Pose graph: constraints, which of them to believe, and the poses that fit them best."""

from lineloom_core.graph.bayes_tree import UnsettledError
from lineloom_core.graph.consistency import (
    CHI2_99,
    consistent_sets,
    cycle_errors,
    largest_consistent_set,
    pairwise_consistent,
)
from lineloom_core.graph.edge import Edge, EdgeKind
from lineloom_core.graph.factors import read_back
from lineloom_core.graph.observability import (
    Observability,
    observe,
    project_out_weak,
    without_direction,
    without_twist,
)
from lineloom_core.graph.piece_join import rigid_join
from lineloom_core.graph.pose_graph import PoseGraph
from lineloom_core.graph.trial import Trial

__all__ = [
    "CHI2_99",
    "Edge",
    "EdgeKind",
    "Observability",
    "PoseGraph",
    "Trial",
    "UnsettledError",
    "consistent_sets",
    "cycle_errors",
    "largest_consistent_set",
    "observe",
    "pairwise_consistent",
    "project_out_weak",
    "read_back",
    "rigid_join",
    "without_direction",
    "without_twist",
]
