"""The pose graph as node-link JSON: networkx reads it by `node_link_graph`."""

from __future__ import annotations

from pydantic import Field

from lineloom.wire.base import Answer, Covariance, Settled


class Submap(Answer):
    """The last metres of a robot's way at one time: what places are recognised by.

    anchor: the keyframe whose frame is the submap's. keyframes: in driving order.
    """

    id: str
    robot: str
    anchor: str
    keyframes: list[str]


class GraphSummary(Answer):
    """Attributes of the graph as a whole."""

    site: str
    version: int
    settled: Settled = False
    submaps: list[Submap] = Field(default_factory=list)


class GraphNode(Answer):
    """A keyframe: pose of the laser in its component's map frame."""

    id: str
    robot: str
    component: str
    session: str
    seq: int
    stamp: float
    x: float
    y: float
    theta: float


class GraphEdge(Answer):
    """A constraint: T_source_target and its information (x, y, theta in the target's axes)."""

    source: str
    target: str
    key: str
    kind: str
    state: str
    x: float
    y: float
    theta: float
    information: Covariance
    residual: float | None = None


class Graph(Answer):
    """Nodes are keyframes, edges are constraints; `key` is the constraint's id."""

    directed: bool = True
    multigraph: bool = True
    graph: GraphSummary
    nodes: list[GraphNode]
    edges: list[GraphEdge]
