"""What a scan is called wherever its log is read: the same under any parameters and any code."""

from __future__ import annotations

from dataclasses import dataclass

from lineloom_core.codec import storable


@storable("scan-name")
@dataclass(frozen=True, slots=True)
class ScanName:
    """repeat: how many keyframes of the same number came before it, where a log has no numbers."""

    robot: str
    session: str
    seq: int
    repeat: int = 0

    def lies_between(self, before: ScanName, after: ScanName) -> bool:
        """Whether it was taken after the one scan of its session and up to the other."""
        stream = (self.robot, self.session)
        return (
            stream == (before.robot, before.session) == (after.robot, after.session)
            and before.seq < self.seq <= after.seq
        )
