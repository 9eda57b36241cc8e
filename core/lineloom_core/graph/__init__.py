"""Pose graph: constraints, which of them to believe, and the poses that fit them best."""

from lineloom_core.graph.consistency import (
    CHI2_99,
    consistent_sets,
    cycle_errors,
    largest_consistent_set,
    pairwise_consistent,
)
from lineloom_core.graph.covariance import (
    Covariances,
    UndeterminedError,
    in_map_axes,
    marginal_covariance,
)
from lineloom_core.graph.edge import Edge, EdgeKind, chi_squared
from lineloom_core.graph.observability import Observability, observe, project_out_weak
from lineloom_core.graph.piece import Piece, together
from lineloom_core.graph.piece_join import rigid_join
from lineloom_core.graph.pose_graph import PoseGraph
from lineloom_core.graph.solver import Solution, optimize, settle

__all__ = [
    "CHI2_99",
    "Covariances",
    "Edge",
    "EdgeKind",
    "Observability",
    "Piece",
    "PoseGraph",
    "Solution",
    "UndeterminedError",
    "chi_squared",
    "consistent_sets",
    "cycle_errors",
    "in_map_axes",
    "largest_consistent_set",
    "marginal_covariance",
    "observe",
    "optimize",
    "pairwise_consistent",
    "project_out_weak",
    "rigid_join",
    "settle",
    "together",
]
