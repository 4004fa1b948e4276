"""Names of files for things whose names come from elsewhere: a name is never a path."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable

_UNUSUAL = re.compile(r"[^A-Za-z0-9._=+-]+")
_LONGEST = 80
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
"""What Windows takes for devices."""


def safe_names(names: Iterable[str]) -> dict[str, str]:
    """Return a file name for each name: no separator, no dot or dash first, different ones for different names.

    Letters, digits and ``._=+-`` stay, every run of anything else becomes ``_``. Names that would come out alike, on
    a file system without upper and lower case too, have the start of their sha256 appended.

    >>> safe_names(["trainingQ/Teddy", "../../etc"])
    {'trainingQ/Teddy': 'trainingQ_Teddy', '../../etc': '_.._etc'}
    """
    plain = {name: _plain(name) for name in names}
    alike = Counter(safe.lower() for safe in plain.values())
    return {name: safe if alike[safe.lower()] == 1 else f"{safe}-{_digest(name)}" for name, safe in plain.items()}


def _plain(name: str) -> str:
    safe = _UNUSUAL.sub("_", name).lstrip(".-").rstrip(".")[:_LONGEST].rstrip(".")
    return f"_{safe}" if not safe or _RESERVED.fullmatch(safe) else safe


def _digest(name: str) -> str:
    return hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
