"""The HTTP contract as types: what a client sends and what the service answers.

Shared by both sides. Needs pydantic and msgpack only: a robot installs it without numpy.
Requests are strict (a bool or a numeric string is not a number); answers ignore fields they do
not know, so that an older client understands a newer service.
"""

from lineloom.wire.base import ID_PATTERN, MAX_BATCH, MAX_BEAMS, MAX_BODY_BYTES, Answer, Request
from lineloom.wire.config import ConfigChange, ParameterValue, SiteConfig
from lineloom.wire.constraint import Constraint, ConstraintPage, StateChange
from lineloom.wire.event import (
    AnyEvent,
    ComponentMergedEvent,
    ComponentSplitEvent,
    ConstraintEvent,
    Event,
    MapEvent,
    RemadeEvent,
    ResetEvent,
    RobotEvent,
    ScanEvent,
)
from lineloom.wire.evidence import (
    CheckLimit,
    ComponentRobots,
    ConstraintDetail,
    MatchedLines,
    RobotMove,
    RunnerUp,
    WhatIf,
)
from lineloom.wire.export import (
    Export,
    ExportList,
    ExportRequest,
    MapDownload,
    MapFrame,
)
from lineloom.wire.floorplan import FloorPlanAnswer, Placement, PlanDifferences, PlanPiece
from lineloom.wire.graph import Graph, GraphEdge, GraphNode, GraphSummary, Submap
from lineloom.wire.ingest import IngestAnswer, RejectedScan, ScanBatch
from lineloom.wire.join import JoinRequest, JoinTrial, PoseRequest
from lineloom.wire.localize import (
    MAX_RUN,
    LocalizeAnswer,
    LocalizeHypothesis,
    LocalizeRequest,
)
from lineloom.wire.map import LAYERS, USUAL_LAYERS, Line, MapAnswer, MapChanges, MapComponent
from lineloom.wire.map_format import MAP_FORMATS, MapFileKind, MapFormat, MapFormatList
from lineloom.wire.match import Alternative, LinePair, MatchAnswer, MatchRequest, MatchScan
from lineloom.wire.packing import JSON, MSGPACK, pack_json, pack_msgpack
from lineloom.wire.pose import PoseAnswer, UncertainPose
from lineloom.wire.problem import FieldError, Problem
from lineloom.wire.robot import MountSettings, Robot, RobotList, RobotSettings
from lineloom.wire.scan import Odometry, Scan
from lineloom.wire.site import Component, Remaking, ScanCounts, Site, SiteList
from lineloom.wire.status import Health, Readiness
from lineloom.wire.trajectory import Trajectory, TrajectoryPose
from lineloom.wire.transform import Transform

__all__ = [
    "ID_PATTERN",
    "JSON",
    "LAYERS",
    "MAP_FORMATS",
    "MAX_BATCH",
    "MAX_BEAMS",
    "MAX_BODY_BYTES",
    "MAX_RUN",
    "MSGPACK",
    "USUAL_LAYERS",
    "Alternative",
    "Answer",
    "AnyEvent",
    "CheckLimit",
    "Component",
    "ComponentMergedEvent",
    "ComponentRobots",
    "ComponentSplitEvent",
    "ConfigChange",
    "Constraint",
    "ConstraintDetail",
    "ConstraintEvent",
    "ConstraintPage",
    "Event",
    "Export",
    "ExportList",
    "ExportRequest",
    "FieldError",
    "FloorPlanAnswer",
    "Graph",
    "GraphEdge",
    "GraphNode",
    "GraphSummary",
    "Health",
    "IngestAnswer",
    "JoinRequest",
    "JoinTrial",
    "Line",
    "LinePair",
    "LocalizeAnswer",
    "LocalizeHypothesis",
    "LocalizeRequest",
    "MapAnswer",
    "MapChanges",
    "MapComponent",
    "MapDownload",
    "MapEvent",
    "MapFileKind",
    "MapFormat",
    "MapFormatList",
    "MapFrame",
    "MatchAnswer",
    "MatchRequest",
    "MatchScan",
    "MatchedLines",
    "MountSettings",
    "Odometry",
    "ParameterValue",
    "Placement",
    "PlanDifferences",
    "PlanPiece",
    "PoseAnswer",
    "PoseRequest",
    "Problem",
    "Readiness",
    "RejectedScan",
    "RemadeEvent",
    "Remaking",
    "Request",
    "ResetEvent",
    "Robot",
    "RobotEvent",
    "RobotList",
    "RobotMove",
    "RobotSettings",
    "RunnerUp",
    "Scan",
    "ScanBatch",
    "ScanCounts",
    "ScanEvent",
    "Site",
    "SiteConfig",
    "SiteList",
    "StateChange",
    "Submap",
    "Trajectory",
    "TrajectoryPose",
    "Transform",
    "UncertainPose",
    "WhatIf",
    "pack_json",
    "pack_msgpack",
]
