"""How the objects of a cache are named."""

import hashlib
import re
import secrets

from semidense.cache.layout import require_key

TAG = "CACHE.TAG"
CLEANING = "cleaning"
_RECORD = re.compile(r"records/([0-9a-f]{2})/(\1[0-9a-f]{62})\.json", re.ASCII)
_PLACE = re.compile(r"[0-9a-f]{32}/[0-9a-f]{64}", re.ASCII)


def record(key: str) -> str:
    """Return the object whose existence makes the entry exist."""
    return f"records/{require_key(key)[:2]}/{key}.json"


def key_of_record(path: str) -> str | None:
    """Return the key of a record's object; None for any other."""
    match = _RECORD.fullmatch(path)
    return match[2] if match else None


def place(lease: str, key: str, maker: str, attempt: int = 0) -> str:
    """Return where a maker makes ``key`` for the run that holds a lease: the same place in all processes of the run."""
    return f"{lease}/{hashlib.sha256(f'{require_key(key)} {attempt} {maker}'.encode()).hexdigest()}"


def is_place(text: object) -> bool:
    """Return whether a text names a place of data."""
    return isinstance(text, str) and _PLACE.fullmatch(text) is not None


def new_lease() -> str:
    """Return a name for a lease that nobody else has."""
    return secrets.token_hex(16)
