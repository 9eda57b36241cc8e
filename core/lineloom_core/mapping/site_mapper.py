"""One site's map as a deterministic state machine over its log of scans and operator actions.

Steps of `SiteMapper.add`, for every scan of any robot:
 1. to 4. make a keyframe of it if it moved on (`front_end`): facts, which nothing later changes;
 5. to 7. close loops, recognise places, join components, optimise (`advance`): beliefs;
 8. where the scan contradicts what was believed, withdraw that and go through the history again
    as if it had never been believed (`rebuild`). So do `retract`, `restore`, `join` and `forget`.

No clock, no randomness, no I/O: the same log gives the same bits, also across `snapshot` and
`resume`. Everything shown is a function of that state (`view`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lineloom_core.codec import decode, encode
from lineloom_core.fusion.occupancy import Rays
from lineloom_core.mapping.advance import advance, contradicted_by_next
from lineloom_core.mapping.answers.evidence import Action, Evidence, JoinTrial, WhatIf
from lineloom_core.mapping.answers.explain import explain
from lineloom_core.mapping.answers.factor_graph import FactorGraph
from lineloom_core.mapping.answers.join_trial import join_trial
from lineloom_core.mapping.answers.localisation import Localisation
from lineloom_core.mapping.answers.localise import localise
from lineloom_core.mapping.answers.ray_source import component_rays
from lineloom_core.mapping.answers.read_factors import read_factors
from lineloom_core.mapping.answers.site_view import SiteView
from lineloom_core.mapping.answers.view_builder import build_view
from lineloom_core.mapping.answers.view_change import EMPTY_VIEW, ViewChange
from lineloom_core.mapping.answers.what_if import what_if
from lineloom_core.mapping.belief.by_reference import dumps, loads
from lineloom_core.mapping.belief.checkpoints import Checkpoints
from lineloom_core.mapping.belief.claim import Claim
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.belief.memory import Memory
from lineloom_core.mapping.belief.rebuild import first_affected, rebuild
from lineloom_core.mapping.belief.sameness import is_meant
from lineloom_core.mapping.belief.site_map import SiteMap
from lineloom_core.mapping.belief.standing import said_of, standing, unplaced_ends
from lineloom_core.mapping.belief.verdicts import Verdicts
from lineloom_core.mapping.changes import Changes
from lineloom_core.mapping.config import MapperConfig
from lineloom_core.mapping.digest import digest
from lineloom_core.mapping.facts.front_end import take
from lineloom_core.mapping.facts.history import History
from lineloom_core.mapping.facts.ids import id_of
from lineloom_core.mapping.facts.keyframe import Keyframe
from lineloom_core.mapping.facts.ordinals import id_of_ordinal
from lineloom_core.mapping.facts.robot_record import RobotRecord
from lineloom_core.mapping.merging.operators_word import measured
from lineloom_core.mapping.snapshot import Snapshot, SnapshotError
from lineloom_core.scan import Mount, Scan

_State = tuple[str, MapperConfig, bytes, bytes]
_Beliefs = tuple[SiteMap, dict[str, RobotRecord], int]


class SiteMapper:
    """The mapper of one site. Not thread safe; one process owns it.

    verdicts: what is known beforehand not to be believed.
    """

    def __init__(
        self, config: MapperConfig | None = None, *, verdicts: Verdicts | None = None
    ) -> None:
        self._config = config or MapperConfig()
        self._history = History(self._config.chapter)
        self._memory = Memory(self._config.recognition, self._history)
        self._site = SiteMap(self._config, self._memory, verdicts)
        self._checkpoints = Checkpoints(self._config, self._history, self._memory)
        self._robots: dict[str, RobotRecord] = {}
        self._version = 0
        self._rest: tuple[int, SiteMap] | None = None
        """What was settled last, at which version: all that rests on it is asked for together."""

    @property
    def version(self) -> int:
        """Number of log entries processed."""
        return self._version

    @property
    def config(self) -> MapperConfig:
        """The parameters."""
        return self._config

    @property
    def verdicts(self) -> Verdicts:
        """What is not to be believed."""
        return self._site.verdicts

    def add(self, robot: str, scan: Scan) -> Changes:
        """Process the next scan of a robot; raises nothing for a scan that `Scan.checked` made."""
        self._version += 1
        record = self._robots.setdefault(robot, RobotRecord(robot))
        taken = take(self._config, self._history, record, scan, self._version)
        if taken.keyframe is None:
            return Changes(placed=taken.placed)
        changes = (
            self._set_apart(robot, taken.keyframe)
            if taken.distrusted
            else self._advance(taken.keyframe, started=taken.started)
        )
        self._history.seal(self._memory.hand_over)
        return changes

    def _advance(self, keyframe: Keyframe, *, started: bool) -> Changes:
        changes = advance(self._site, keyframe)
        if changes.withdrawn:
            self._rebuild(self._site.verdicts.withdraw(changes.withdrawn))
        else:
            self._checkpoints.note(self._site, keyframe.id)
        if not started:
            return changes
        return replace(changes, started_component=id_of("component", keyframe.scan_name))

    def set_mount(self, robot: str, mount: Mount) -> None:
        """Set where a robot's lidar sits; `inverted` counts for the scans that follow."""
        self._version += 1
        record = self._robots.setdefault(robot, RobotRecord(robot))
        if record.mount.inverted != mount.inverted:
            record.tracker = None
            record.trust_again()
        record.mount = mount

    def forget(self, robot: str) -> None:
        """Drop a robot with everything that rests on its scans, as if it had never been here."""
        self._version += 1
        if self._robots.pop(robot, None) is None:
            return
        gone = set(self._history.of(robot))
        self._history.forget(robot)
        self._memory.forget(gone)
        self._rebuild(self._site.verdicts.without(gone).operators_only(), min(gone, default=None))

    def note(self) -> None:
        """Count a log entry that changes nothing: parameters hold from the first scan on."""
        self._version += 1

    def retract(self, constraint: str | Claim) -> None:
        """Make the map as if the constraint had never been accepted, for good.

        Of a recognition, all that says the same is refused with it. A retracted one, or one of
        which only an id is known, and no constraint of that id, changes nothing. A claim that no
        constraint makes stands (`standing`), and bars what makes it when that comes up.
        """
        self._version += 1
        known = self._named(constraint)
        if known is not None and known.id not in self._site.verdicts.retracted:
            self._rebuild(self._retracting(known).operators_only())

    def restore(self, constraint: str | Claim) -> None:
        """Take a retraction back, or overrule a withdrawal; the map is as if it had not been.

        A claim of which neither is known is vouched for: what makes it is never withdrawn.
        """
        self._version += 1
        known, verdicts = self._named(constraint), self._site.verdicts
        if known is None:
            return
        meant = [c.id for c in verdicts.withdrawn.values() if is_meant(self._site, known, c)]
        barred = [known.id] if verdicts.barred(known.id) else meant
        for name in barred:
            verdicts = verdicts.restore(name)
        if barred:
            self._rebuild(verdicts.operators_only())
        elif isinstance(constraint, Claim):
            self._site.verdicts = verdicts.vouch(known)

    def join(self, claim: Claim) -> None:
        """Believe that two scans lie so, give or take what the matcher finds: an operator says so.

        Of scans that are in no map it changes nothing, which the robots' health tells.
        """
        self._version += 1
        said = self._said(claim, guessed=True)
        self._note_unmet(claim, met=said is not None)
        if said is not None:
            before = self._site.verdicts.barred(said.id) or self._site.constraints.get(said.id)
            said = replace(said, history=before.history if before else ())
            said = said.moved_to("accepted", said.reason, self._version)
            self._rebuild(self._site.verdicts.join(said).operators_only())

    def try_join(self, claim: Claim, guessed: bool) -> JoinTrial | None:
        """What `join` would come to; changes nothing. guessed: whether the claim says how they lie.

        None for scans that are in no map, and where the two have nothing in common.
        """
        said = self._said(claim, guessed=guessed)
        return None if said is None else join_trial(self._site, self._history, said)

    def _said(self, claim: Claim, *, guessed: bool) -> Constraint | None:
        found = said_of(claim, self._history, self._robots)
        if found is None or not all(self._site.knows(k) for k in found[:2]) or found[0] == found[1]:
            return None
        a, b, T_a_b = found
        return measured(self._site, self._history, claim, a, b, T_a_b if guessed else None)

    def what_if(self, constraint: str) -> WhatIf | None:
        """What retracting a constraint (or restoring a retracted one) would do; changes nothing.

        None for an unknown one.
        """
        known = self._find(constraint)
        if known is None:
            return None
        action: Action = "restore" if self._site.verdicts.barred(known.id) else "retract"
        verdicts = (
            self._retracting(known)
            if action == "retract"
            else self._site.verdicts.restore(known.id)
        )
        other = self._rebuilt(self._checkpoints.copy(), verdicts.operators_only())
        return what_if(action, known.id, self._site, other, self._robots)

    def explain(self, constraint: str) -> Evidence | None:
        """What speaks for a constraint and against it; None for an unknown one."""
        known = self._find(constraint)
        return None if known is None else explain(self._site, self._history, known)

    def localise(self, scans: Sequence[Scan]) -> Localisation:
        """Where one robot's scans were taken, the latest counts; changes nothing."""
        return localise(self._site, scans)

    def rays(self, component: str, settled: bool = False) -> Rays:
        """Return what the lidars saw as free, for an occupancy grid; changes nothing."""
        return component_rays(self._shown(settled), component)

    def view(self, *, settled: bool = False) -> SiteView:
        """Everything there is to know at this version; changes nothing.

        settled: at the optimum of all constraints, which poses otherwise are within millimetres of.
        """
        return build_view(self._shown(settled), self._robots, self._version, settled=settled)

    def settled(self) -> ViewChange:
        """The settled view, as the change that it is from an empty one."""
        return ViewChange.between(EMPTY_VIEW, self.view(settled=True))

    def factors(self) -> FactorGraph:
        """What gtsam holds of the settled site."""
        return read_factors(self._shown(settled=True), self._version)

    def _shown(self, settled: bool) -> SiteMap:
        if not settled:
            return self._site
        if self._rest is None or self._rest[0] != self._version:
            self._rest = self._version, self._site.settled()
        return self._rest[1]

    def snapshot(self, known: int = 0) -> Snapshot:
        """The whole state, for `resume`, without the first `known` chapters of the history."""
        facts = encode((self._history, self._memory))
        beliefs = dumps((self._site, self._robots, self._version))
        state = encode((digest(self._config), self._config, facts, beliefs))
        return Snapshot(state, known, self._history.chapters(known))

    @classmethod
    def resume(cls, snapshot: Snapshot) -> SiteMapper:
        """Go on from a whole snapshot. Raises SnapshotError where it cannot be read."""
        try:
            made, config, facts, beliefs = decode(snapshot.state, _State)
            if made != digest(config):
                raise SnapshotError(f"made by {made}, which is not {digest(config)}")
            history, memory = decode(facts, tuple[History, Memory])
            history.bind(snapshot.chapters if snapshot.first == 0 else ())
            site, robots, version = loads(beliefs, _Beliefs, history, memory, config)
        except SnapshotError:
            raise
        except Exception as error:
            raise SnapshotError(f"unreadable snapshot: {error}") from error
        memory.sealed = history
        mapper = cls(config)
        mapper._memory, mapper._history, mapper._site = memory, history, site
        mapper._robots, mapper._version = robots, version
        mapper._checkpoints = Checkpoints(config, history, memory)
        return mapper

    def _set_apart(self, robot: str, keyframe: Keyframe) -> Changes:
        """Go through the history again without places of a robot whose lidar is certainly wrong."""
        frames = self._site.keyframes
        tied = [
            c
            for _, c in sorted(self._site.constraints.items())
            if c.state == "accepted"
            and c.kind == "rendezvous"
            and robot in (frames[c.keyframe_a].robot, frames[c.keyframe_b].robot)
        ]
        session = keyframe.scan.session
        self._rebuild(self._site.verdicts, self._history.of(robot, session)[0])
        kept = self._site.constraints
        gone = (c for c in tied if c.id not in kept or kept[c.id].state != "accepted")
        return Changes(placed=True, keyframe=keyframe.name, withdrawn=tuple(gone), optimised=True)

    def _find(self, constraint: str) -> Constraint | None:
        name = id_of_ordinal(constraint, self._history)
        return self._site.verdicts.barred(name) or self._site.constraints.get(name)

    def _named(self, constraint: str | Claim) -> Constraint | None:
        """The constraint of an id, or what makes a claim, or else what stands for it."""
        if isinstance(constraint, str):
            return self._find(constraint)
        found = self._find(constraint.constraint)
        places = self._config.places
        found = found or standing(constraint, self._history, self._robots, places)
        self._note_unmet(constraint, met=found is not None)
        return found

    def _note_unmet(self, claim: Claim, *, met: bool) -> None:
        """Let the robots' health tell of what an operator says of scans that are in no map."""
        for record in self._robots.values():
            record.unmet.pop(claim.constraint, None)
        for name in () if met else unplaced_ends(claim, self._history, self._robots):
            if name.robot in self._robots:  # else it was forgotten since
                self._robots[name.robot].unmet[claim.constraint] = name.session

    def _retracting(self, constraint: Constraint) -> Verdicts:
        gone = constraint.moved_to("retracted", "retracted by an operator", self._version)
        return self._site.verdicts.retract(gone)

    def _rebuild(self, verdicts: Verdicts, affected: int | None = None) -> None:
        self._site = self._rebuilt(self._checkpoints, verdicts, affected)

    def _rebuilt(
        self, checkpoints: Checkpoints, verdicts: Verdicts, affected: int | None = None
    ) -> SiteMap:
        """The map under other verdicts, and with other keyframes from `affected` on."""
        first = [first_affected(moved)] if (moved := self._site.verdicts.moved(verdicts)) else []
        if affected is not None:
            first.append(affected)
        return rebuild(checkpoints, verdicts, min(first, default=0), contradicted_by_next)
