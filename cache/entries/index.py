"""Find entries by what is in them: recipes name their inputs by stage and digest, not by key."""

from collections.abc import Iterable

from semidense.cache.entries.entry import Entry
from semidense.cache.keys.recipe import Recipe

Content = tuple[str, str]
"""Stage and output digest of an entry."""


class Index:
    """Some entries by stage and digest. Equal content may have several entries, such as one a scene."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        self._entries: dict[Content, list[Entry]] = {}
        for entry in entries:
            self._entries.setdefault((entry.recipe.stage, entry.digest), []).append(entry)

    def find(self, stage: str, digest: str, **label: str) -> Entry | None:
        """Return the newest entry with this content, of those with this label if there are any; None without one.

        Args:
            stage: name of the product.
            digest: of the content.
            label: part of the label, such as ``scene="Teddy"``.
        """
        found = self._entries.get((stage, digest), ())
        return max(found, key=lambda entry: (label.items() <= entry.label.items(), entry.created), default=None)


def inputs_of(recipe: Recipe) -> dict[str, tuple[str, ...]]:
    """Return the digests of each input by stage: one, or of an input that is many results all of them."""
    return {stage: tuple(_digests(value)) for stage, value in recipe.inputs.items()}


def _digests(value: object) -> Iterable[str]:
    if isinstance(value, str):
        return [value]
    return [str(each) for each in (value.values() if isinstance(value, dict) else value)]  # type: ignore[attr-defined]
