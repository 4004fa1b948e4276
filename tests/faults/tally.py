"""What came of the faults of one row of the matrix."""

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class Tally:
    """Counts of one row; everything but ``injected`` must stay zero.

    Attributes:
        injected: faults, bad inputs, or changes.
        wrong: results that differ from an undisturbed run's and were not refused.
        lost: sound products that were there before a fault and not after it.
        leftovers: drafts, locks and leases that nobody owns, after the next run.
        tracebacks: errors that are not one line for the user.
        notes: what was wrong, for whoever has to find it.
        figures: further counts of the row.
    """

    injected: int = 0
    wrong: int = 0
    lost: int = 0
    leftovers: int = 0
    tracebacks: int = 0
    notes: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    @property
    def clean(self) -> bool:
        """Whether nothing was wrong, lost, left over or unexplained."""
        return not (self.wrong or self.lost or self.leftovers or self.tracebacks)

    def fail(self, what: str, note: str) -> None:
        """Count a failure of a kind, and say which."""
        setattr(self, what, getattr(self, what) + 1)
        self.notes.append(f"{what}: {note}"[:300])

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain JSON types."""
        return asdict(self)
