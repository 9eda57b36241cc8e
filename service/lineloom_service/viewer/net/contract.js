/**
 * The service's answers, as far as the viewer reads them. `/openapi.json` is the whole truth.
 *
 * @typedef {import("../geometry/pose.js").Pose} Pose
 *
 * @typedef {Record<string, {title: string, media_type: string, suffix: string}>} MapFormats
 * @typedef {{accepted: number, processed: number, pending: number, skipped: number}} ScanCounts
 * @typedef {{id: string, robots: string[], keyframes: number}} ComponentAnswer
 * @typedef {{site: string, version: number, settled: boolean, idle: boolean, scans: ScanCounts, robots: string[],
 *   components: ComponentAnswer[], merged_into: Object<string, string>,
 *   constraints: Object<string, Object<string, number>>, trouble?: string|null,
 *   remaking?: RemakingAnswer|null}} SiteAnswer
 * @typedef {{position: number, of: number, why: string}} RemakingAnswer
 *
 * @typedef {{robot: string, component: string|null, state: "starting"|"tracking"|"lost"|"silent",
 *   pose: (Pose & {covariance: (number|null)[][]|null})|null, scans: ScanCounts,
 *   keyframes: number, latest_stamp: number|null, latest_session: string|null,
 *   latest_seq: number|null, health: string[]}} RobotAnswer
 *
 * @typedef {{id: string, component: string, x1: number, y1: number, x2: number, y2: number,
 *   sigma: number, support: number, robots: string[], first_seen: number,
 *   last_seen: number, layer: "wall"|"furniture"|"clutter", wall: string}} LineAnswer
 * @typedef {{site: string, version: number, settled: boolean,
 *   components: {id: string, robots: string[]}[],
 *   lines: LineAnswer[]}} MapAnswer
 *
 * @typedef {{id: string, robot: string, component: string, session: string, seq: number,
 *   stamp: number, x: number, y: number, theta: number}} GraphNode
 * @typedef {{source: string, target: string, key: string, kind: string, state: string,
 *   residual: number|null}} GraphEdge
 * @typedef {{id: string, robot: string, anchor: string, keyframes: string[]}} Submap
 * @typedef {{graph: {site: string, version: number, submaps?: Submap[]}, nodes: GraphNode[],
 *   edges: GraphEdge[]}} GraphAnswer
 *
 * @typedef {"sequential"|"loop"|"rendezvous"|"operator"} ConstraintKind
 * @typedef {"candidate"|"accepted"|"rejected"|"retracted"} ConstraintState
 * @typedef {{at_least: number|null, at_most: number|null, holds: boolean, means?: string,
 *   unit?: string, log_odds?: number|null}} Limit
 * @typedef {{reference: number[], current: number[], overlap: number, distance: number,
 *   angle: number}} MatchedPair
 * @typedef {{id: string, kind: ConstraintKind, state: ConstraintState, keyframe_a: string,
 *   keyframe_b: string, robot_a: string|null, robot_b: string|null, T_a_b: Pose, reason: string,
 *   checks: Object<string, number|null>, consistency_set: string[], residual: number|null,
 *   history?: {version: number, state: string, reason: string}[],
 *   limits?: Object<string, Limit>|null, matched?: MatchedPair[]|null, conflicts?: number[][]|null,
 *   votes?: number|null, runner_up?: (Pose & {evidence: number})|null,
 *   margin?: number|null}} ConstraintAnswer
 * All from `limits` on is known of a constraint that was asked for alone; null where the mapper
 * could not be asked.
 *
 * @typedef {{id: string, robots: string[]}} ComponentRobots
 * @typedef {{action: "retract"|"restore", constraint: string, components_before: ComponentRobots[],
 *   components_after: ComponentRobots[], robots: {robot: string, moved_m: number|null,
 *   turned_rad: number|null, component_before: string|null,
 *   component_after: string|null}[]}} WhatIfAnswer
 *
 * @typedef {{constraint: string, component_a: string, component_b: string, T_a_b: Pose,
 *   T_components: Pose|null, fits: boolean, reason: string, objections: string[],
 *   checks: Object<string, number|null>, limits: Object<string, Limit>, matched: MatchedPair[],
 *   conflicts: number[][]}} JoinTrialAnswer
 *
 * @typedef {Pose & {component: string, covariance: (number|null)[][]|null, score: number,
 *   checks: Object<string, number|null>, limits?: Object<string, Limit>}} HypothesisAnswer
 * @typedef {{verdict: "unique"|"ambiguous"|"unknown", hypotheses: HypothesisAnswer[],
 *   reason: string, scan: number|null}} LocalizeAnswer
 *
 * @typedef {{component: string, verdict: "registered"|"ambiguous"|"none", reason: string,
 *   T_plan_map: Pose|null}} PlacementAnswer
 * @typedef {{site: string, version: number, components: PlacementAnswer[]}} FloorPlanAnswer
 * @typedef {{x1: number, y1: number, x2: number, y2: number, line: string|null}} PlanPiece
 * @typedef {{component: string, missing: PlanPiece[], new: PlanPiece[]}} PlanDifferencesAnswer
 *
 * @typedef {{seq: number, stamp: number, component: string | null, x: number | null, y: number | null,
 *   theta: number | null}} TrajectoryPose
 */
export {};
