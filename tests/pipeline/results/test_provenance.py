from pathlib import Path

import numpy as np
import pytest

from semidense.pipeline.results.provenance import Ancestor, Provenance, ancestry, single_inputs, tree_lines
from tests.handmade import Handmade, handmade


@pytest.fixture
def made(tmp_path: Path) -> Handmade:
    return handmade(tmp_path / "cache")


def names(chain: list[Ancestor]) -> list[str]:
    return [each.product for each in chain]


def test_ancestors_are_nearest_first_and_each_once(made: Handmade) -> None:
    chain = ancestry(made.store, made.entries["confidence"].key)
    assert names(chain) == ["confidence", "disparity", "images", "costvolume", "channels"]


def test_a_chain_is_what_is_above_a_product(made: Handmade) -> None:
    provenance = Provenance(made.store.entries())
    chain = provenance.chain(made.entries["confidence"])
    assert list(chain) == ["confidence", "disparity", "images", "costvolume", "channels"]
    assert chain["channels"] == made.entries["channels"]


def test_what_was_made_from_a_product(made: Handmade) -> None:
    provenance = Provenance(made.store.entries())
    images = made.entries["images"]
    assert [entry.recipe.stage for entry in provenance.made_from(("images", images.digest))] == [
        "channels",
        "confidence",
    ]
    assert single_inputs(made.entries["channels"]) == [("images", images.digest)]
    assert not provenance.made_from(("images", "00"))


def test_of_two_scenes_with_the_same_content_the_own_one_is_meant(made: Handmade) -> None:
    arrays = dict(made.arrays["images"])
    first = made.entries["channels"]
    other = Handmade(made.store, {}, {}, scene="Other")
    other.write("images", {"file": 2}, (), **arrays)
    assert other.entries["images"].digest == made.entries["images"].digest
    chain = Provenance(made.store.entries()).chain(first)
    assert chain["images"] == made.entries["images"]


def test_a_product_that_is_named_again_is_not_told_again(made: Handmade) -> None:
    made.write("semidense", {"R": 0.9}, ("disparity", "confidence"), disparity=np.zeros((60, 90), np.float32))
    lines = list(tree_lines(ancestry(made.store, made.entries["semidense"].key)))
    assert sum("(as above)" in line for line in lines) == 1
    assert any("settings: R=0.9" in line for line in lines)
