"""Small sealed JSON files: the records and manifests of the cache.

A document has exactly one spelling, and carries the checksum of its own content. So any changed
byte of the file is noticed, also one that JSON itself would forgive, such as white space.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from math import isfinite
from typing import Any, NoReturn, TypeAlias

from semidense.cache.errors import InvalidRecipe

FORMAT_VERSION = 1
"""The version of keys, records and manifests; it enters every key."""

Json: TypeAlias = dict[str, Any] | list[Any] | str | int | float | bool | None
_SCALARS = (str, int, float, bool, type(None))


def plain(value: object) -> Json:
    """Return ``value`` as plain JSON types: dicts with text keys, lists, scalars; tuples become lists.

    Raises:
        InvalidRecipe: for NaN, infinities and every other type, NumPy scalars included: their
            spelling is not promised to stay.
    """
    if isinstance(value, _SCALARS) and type(value) in _SCALARS:
        if isinstance(value, float) and not isfinite(value):
            raise InvalidRecipe(f"{value!r} has no JSON spelling: use None or text in its place")
        return value
    if isinstance(value, Mapping):
        return plain_mapping("value", value)
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise InvalidRecipe(f"{value!r} is a {type(value).__name__}: convert it to a plain str, int, float, bool or list")


def plain_mapping(name: str, value: object) -> dict[str, Any]:
    """Return a mapping as a dict of plain JSON types.

    Raises:
        InvalidRecipe: naming it, if it is not a mapping or holds what JSON cannot.
    """
    if not isinstance(value, Mapping):
        raise InvalidRecipe(f"{name} must be a mapping, not {value!r}")
    return {_text(key): plain(item) for key, item in value.items()}


def _text(key: object) -> str:
    """Return a mapping's key if it is text; JSON would silently turn 1 and "1" into the same one."""
    if not isinstance(key, str) or type(key) is not str:
        raise InvalidRecipe(f"the mapping key {key!r} is a {type(key).__name__}: only text can be one")
    return key


def canonical(value: object) -> str:
    """Return the one canonical JSON text of ``value``: sorted keys, no spaces, ASCII only.

    >>> canonical({"b": (1, 2.0), "a": None})
    '{"a":null,"b":[1,2.0]}'

    Raises:
        InvalidRecipe: as ``plain`` does.
    """
    return _spelled(plain(value))


def _spelled(value: Json) -> str:
    """As ``canonical``, of what is plain already."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: object) -> str:
    """Return the sha256 of the canonical JSON of ``value``, in hexadecimal."""
    return _hash(canonical(value))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def parse(text: str) -> dict[str, Any]:
    """Read strict JSON of one object.

    Raises:
        ValueError: for anything else, for NaN and infinities, and for a repeated key.
    """
    try:
        value = json.loads(text, object_pairs_hook=_unique, parse_constant=_refuse_constant)
        plain(value)  # nested too deeply for that is too deep for all that follows
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if isinstance(value, dict):
        return value
    raise ValueError("it is not a JSON object")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Build an object whose keys are all different."""
    result = dict(pairs)
    if len(result) != len(pairs):
        raise ValueError("a key is repeated")
    return result


def _refuse_constant(name: str) -> NoReturn:
    """Refuse the constants that Python's reader knows and JSON does not."""
    raise ValueError(f"{name} is not JSON")


def seal(kind: str, content: Mapping[str, Any]) -> bytes:
    """Return the file of a document: its content, kind, format and checksum, readable."""
    return _sealed({**plain_mapping(kind, content), "kind": kind, "format": FORMAT_VERSION})


def _sealed(body: dict[str, Any]) -> bytes:
    return (laid_out(_spelled({**body, "checksum": _hash(_spelled(body))})) + "\n").encode("ascii")


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|\{\}|\[\]|[\[\]{},:]|[^\[\]{},:"]+', re.ASCII)


def laid_out(compact: str) -> str:
    """Return canonical JSON a value a line, as ``json.dumps(indent=1)`` does, in a fifth of its time.

    A plan reads thousands of documents, and compares each with how it would be written.
    """
    parts: list[str] = []
    line = "\n"
    for token in _TOKEN.findall(compact):
        if token in ("{", "["):
            line += " "
            parts += (token, line)
        elif token in ("}", "]"):
            line = line[:-1]
            parts += (line, token)
        elif token == ",":
            parts += (",", line)
        else:
            parts.append(": " if token == ":" else token)
    return "".join(parts)


def unseal(kind: str, data: bytes) -> dict[str, Any]:
    """Return the content of a document that ``seal`` wrote.

    Raises:
        ValueError: saying what is wrong, if one byte differs from what was written, or if it is
            of another kind or format.
    """
    sealed = parse(data.decode("ascii"))
    if sealed.get("format") != FORMAT_VERSION:
        raise ValueError(f"has format {sealed.get('format')!r}, this program reads {FORMAT_VERSION}")
    if sealed.get("kind") != kind:
        raise ValueError(f"is a {sealed.get('kind')!r}, expected a {kind!r}")
    body = {name: value for name, value in sealed.items() if name != "checksum"}
    if _sealed(body) != data:
        raise ValueError("its checksum or spelling differs from what was written")
    return {name: value for name, value in body.items() if name not in ("kind", "format")}
