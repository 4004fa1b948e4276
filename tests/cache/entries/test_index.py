from pathlib import Path

import numpy as np
import pytest

from semidense.cache import Entry, Recipe, Store
from semidense.cache.entries.index import Index, inputs_of

DIGEST = "ab" * 32


def write(store: Store, param: int, scene: str) -> Entry:
    """Publish the same content, made with other settings."""
    recipe = Recipe("square", {}, {"n": param}, {}, {})
    with store.begin(recipe, {"scene": scene}) as draft:
        draft.create_array("square", (2,), "int64", chunks=(2,), dims=("n",), attrs={})
        draft.write("square", (slice(0, 2),), np.array([0, 1]))
    return store.require(recipe.key)


@pytest.fixture
def entries(tmp_path: Path) -> list[Entry]:
    return [write(Store(tmp_path), param, scene) for param, scene in enumerate(("a", "b", "a", "b"))]


def test_of_equal_content_the_newest_is_found(entries: list[Entry]) -> None:
    index = Index(reversed(entries))
    assert len({entry.digest for entry in entries}) == 1
    assert index.find("square", entries[0].digest) == entries[3]
    assert index.find("square", entries[0].digest, scene="a") == entries[2]
    assert index.find("square", entries[0].digest, scene="gone") == entries[3], "a label is a preference"


def test_other_content_is_not_found(entries: list[Entry]) -> None:
    assert Index(entries).find("square", DIGEST) is None
    assert Index(entries).find("root", entries[0].digest) is None
    assert Index(()).find("square", entries[0].digest) is None


def test_inputs_are_one_digest_or_many() -> None:
    recipe = Recipe("net", {}, {}, {"images": "a", "samples": ["b", "c"], "weights": {"x": "d"}}, {})
    assert inputs_of(recipe) == {"images": ("a",), "samples": ("b", "c"), "weights": ("d",)}
