"""How good an answer is: poses, trajectories, scan pairs."""

from lineloom_lab.evaluation.pairs import (
    Pair,
    PairScore,
    PairSet,
    TierScore,
    load_pairs,
    run_matcher,
    score_pairs,
)
from lineloom_lab.evaluation.pose_error import PoseError, pose_error
from lineloom_lab.evaluation.trajectory import (
    DegenerateTrajectoryError,
    TrajectoryError,
    align_rigid,
    trajectory_error,
)

__all__ = [
    "DegenerateTrajectoryError",
    "Pair",
    "PairScore",
    "PairSet",
    "PoseError",
    "TierScore",
    "TrajectoryError",
    "align_rigid",
    "load_pairs",
    "pose_error",
    "run_matcher",
    "score_pairs",
    "trajectory_error",
]
