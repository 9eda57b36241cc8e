"""What is believed or not whatever the scans say: joined or retracted by an operator, or withdrawn.

A verdict stands above the evidence: a pair that was retracted is never proposed again, and what
says the same as a retracted recognition is refused with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from lineloom_core.codec import storable
from lineloom_core.mapping.belief.constraint import Constraint
from lineloom_core.mapping.facts.scan_name import ScanName


@storable("verdicts")
@dataclass(frozen=True)
class Verdicts:
    """retracted: by an operator, withdrawn: by the mapper; both by constraint id, as they were.

    approved: restored by an operator after they had been withdrawn, so never withdrawn again.
    vouched: restored though nothing was withdrawn yet that they mean (`sameness`), by id.
    joined: what an operator says is so, measured when it was said, by id.
    """

    retracted: Mapping[str, Constraint] = field(default_factory=dict)
    withdrawn: Mapping[str, Constraint] = field(default_factory=dict)
    approved: frozenset[str] = frozenset()
    vouched: Mapping[str, Constraint] = field(default_factory=dict)
    joined: Mapping[str, Constraint] = field(default_factory=dict)

    def barred(self, constraint_id: str) -> Constraint | None:
        """The retracted or withdrawn constraint of this id, if there is one."""
        return self.retracted.get(constraint_id) or self.withdrawn.get(constraint_id)

    def cuts(self, step: str, before: ScanName, after: ScanName) -> bool:
        """Whether the step of this id, from one scan to another, is barred."""
        return self.barred(step) is not None or any(
            c.claim is not None
            and c.origin == "step"
            and c.claim.scan_b.lies_between(before, after)
            for c in self.retracted.values()
        )

    def all_barred(self) -> tuple[Constraint, ...]:
        """Everything that is not to be believed, oldest first."""
        return (*self.retracted.values(), *self.withdrawn.values())

    def all_told(self) -> tuple[Constraint, ...]:
        """Everything that must not be let go of, because somebody may look at it again."""
        return (*self.all_barred(), *self.joined.values())

    def join(self, constraint: Constraint) -> Verdicts:
        """This one is so, says an operator."""
        return replace(
            self,
            joined={**self.joined, constraint.id: constraint},
            retracted=_without(self.retracted, constraint.id),
            withdrawn=_without(self.withdrawn, constraint.id),
        )

    def retract(self, constraint: Constraint) -> Verdicts:
        """Also this one is not to be believed, says an operator."""
        return replace(
            self,
            retracted={**self.retracted, constraint.id: constraint},
            withdrawn=_without(self.withdrawn, constraint.id),
            approved=self.approved - {constraint.id},
            vouched=_without(self.vouched, constraint.id),
            joined=_without(self.joined, constraint.id),
        )

    def withdraw(self, constraints: tuple[Constraint, ...]) -> Verdicts:
        """Later scans contradict these."""
        return replace(self, withdrawn={**self.withdrawn, **{c.id: c for c in constraints}})

    def restore(self, constraint_id: str) -> Verdicts:
        """An operator takes the word back, or overrules the mapper's."""
        gone = self.retracted.get(constraint_id)
        if gone is not None and gone.kind == "operator":
            said = next(move.reason for move in gone.history if move.state == "accepted")
            return self.join(replace(gone, state="accepted", reason=said))
        overruled = {constraint_id} if constraint_id in self.withdrawn else set()
        return replace(
            self,
            retracted=_without(self.retracted, constraint_id),
            withdrawn=_without(self.withdrawn, constraint_id),
            approved=self.approved | overruled,
        )

    def vouch(self, constraint: Constraint) -> Verdicts:
        """This one, or what it stands for, is not to be withdrawn, says an operator."""
        if constraint.claim is None:
            return replace(self, approved=self.approved | {constraint.id})
        return replace(self, vouched={**self.vouched, constraint.id: constraint})

    def operators_only(self) -> Verdicts:
        """The mapper's own verdicts left aside: they follow from the history anew."""
        return replace(self, withdrawn={})

    def moved(self, other: Verdicts) -> tuple[Constraint, ...]:
        """Constraints on which the two differ."""
        groups = (
            (self.retracted, other.retracted),
            (self.withdrawn, other.withdrawn),
            (self.joined, other.joined),
        )
        return tuple(
            {**mine, **theirs}[name]
            for mine, theirs in groups
            for name in sorted(mine.keys() | theirs.keys())
            if mine.get(name) is not theirs.get(name)
        )

    def without(self, keyframes: set[int]) -> Verdicts:
        """The same where these keyframes are forgotten."""
        kept = (
            {i: c for i, c in group.items() if not {c.keyframe_a, c.keyframe_b} & keyframes}
            for group in (self.retracted, self.withdrawn, self.vouched, self.joined)
        )
        retracted, withdrawn, vouched, joined = kept
        return Verdicts(retracted, withdrawn, self.approved, vouched, joined)


def _without(items: Mapping[str, Constraint], key: str) -> dict[str, Constraint]:
    return {k: c for k, c in items.items() if k != key}
