"""Other people's matchers from PyPI behind our interface (dependency group `peers`).

Each is loaded when it is made; `ImportError` says that it is not installed. They are given the best
chance we found, on the very pairs they are measured on: how a flat scan is fed to each is told at
the top of its file. None of them says what score to believe: `least_score` is, as for the
baselines, where about nine answers of ten were right on simulated pairs.
"""

from lineloom_lab.evaluation.peers.karto import KartoMatcher
from lineloom_lab.evaluation.peers.kiss_matcher_quatro import KissMatcherMatcher
from lineloom_lab.evaluation.peers.open3d_fpfh import Open3dMatcher
from lineloom_lab.evaluation.peers.small_gicp_icp import SmallGicpMatcher

__all__ = ["KartoMatcher", "KissMatcherMatcher", "Open3dMatcher", "SmallGicpMatcher"]
