"""Monitors for training: one that remembers, and that can stop the work as a crash would."""

from dataclasses import dataclass, field


class InterruptedTrainingError(Exception):
    """The work was stopped from outside."""


@dataclass
class Memory:
    """Keep every checkpoint and every report; raise at the report of step ``stop_after``."""

    stop_after: int | None = None
    states: list[bytes] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    totals: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)

    def progress(self, done: int, total: int, note: str = "") -> None:
        self.steps.append(done)
        self.totals.add(total)
        self.notes.append(note)
        if done == self.stop_after:
            raise InterruptedTrainingError

    def save(self, state: bytes) -> None:
        self.states.append(state)

    def load(self) -> bytes | None:
        return self.states[-1] if self.states else None
