"""Say what a publisher offers of a benchmark: the module of a benchmark names it in ``PUBLICATIONS``."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A file that a publisher offers.

    Attributes:
        address: where, https.
        folder: where it belongs below the folder of all data: an archive is unpacked there, another file is put there.
    """

    address: str
    folder: str


@dataclass(frozen=True)
class Publication:
    """A part of a benchmark that is fetched as a whole.

    Attributes:
        name: what is typed to fetch it.
        spec: the specification of the copy, with its folder below the folder of all data after the colon.
        sources: its files, in the order in which they are unpacked.
        licence: in a few words.
        cite: the paper to cite.
        home: the publisher's page.
        megabytes: about what is downloaded; None if it is not known.
        confirmed: whether the addresses were found in public use; else they follow the pattern of the others.
    """

    name: str
    spec: str
    sources: tuple[Source, ...]
    licence: str
    cite: str
    home: str
    megabytes: int | None = None
    confirmed: bool = True

    def folder(self, data: Path) -> Path:
        """Return the folder of the copy, below the folder of all data."""
        return data / self.spec.partition(":")[2]

    def spec_of(self, data: Path) -> str:
        """Return the specification of the copy, as commands take it."""
        return f"{self.spec.partition(':')[0]}:{self.folder(data)}"
