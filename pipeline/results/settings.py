"""To which configuration an entry belongs: the settings, its own and those above it, that are not the defaults."""

from collections.abc import Iterable

from pydantic_core import to_jsonable_python

from semidense.cache import Entry
from semidense.pipeline.plan.config import Config
from semidense.pipeline.plan.environment import former_version

DEFAULTS = "defaults"


class Belonging:
    """Tells the settings of entries, given all entries of their cache."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        self._by_content: dict[tuple[str, str], Entry] = {}
        for entry in entries:
            self._by_content.setdefault((entry.recipe.stage, entry.digest), entry)
        self._known: dict[str, frozenset[str]] = {}

    def text(self, entry: Entry) -> str:
        """Return the settings, such as ``channels.rank_window=15 semidense.R=0.8``, or that they are the defaults."""
        if version := former_version(entry):
            return f"of version {version}"
        return " ".join(sorted(self._settings(entry))) or DEFAULTS

    def _settings(self, entry: Entry) -> frozenset[str]:
        if entry.key not in self._known:
            self._known[entry.key] = frozenset(_own(entry))  # before what is above: a hostile record may name itself
            above = [self._by_content.get(each) for each in _inputs(entry)]
            found = [self._settings(each) for each in above if each]
            self._known[entry.key] = self._known[entry.key].union(*found)
        return self._known[entry.key]


def _own(entry: Entry) -> Iterable[str]:
    """Yield the entry's own settings that were chosen; what a run fills in by itself has an open default."""
    defaults = to_jsonable_python(dict(Config.load().section(entry.recipe.stage)))  # those that no key has, too
    for name, value in entry.recipe.params.items():
        if name in defaults and defaults[name] not in (None, "auto", value):
            yield f"{entry.recipe.stage}.{name}={_text(value)}"


def _text(value: object) -> str:
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _inputs(entry: Entry) -> Iterable[tuple[str, str]]:
    for product, value in entry.recipe.inputs.items():
        digests = [value] if isinstance(value, str) else value if isinstance(value, list) else []
        yield from ((product, digest) for digest in digests)
