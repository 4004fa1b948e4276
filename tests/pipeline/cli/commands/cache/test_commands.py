"""The `cache` commands on a cache of toy entries: nothing heavy is needed for them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semidense.cache import Recipe, Store, code_hash_of
from semidense.pipeline.results.provenance import ancestry, tree_lines
from tests.pipeline.toy import chain

Invoke = Callable[..., Any]


@pytest.fixture
def filled(toy_run: Callable[..., Any], store: Store) -> Store:
    """Two variants of a chain: one ramp, two blurred, two sums."""
    toy_run(chain(offset=1))
    toy_run(chain(offset=2))
    return store


def test_entries_are_listed_and_chosen(invoke: Invoke, filled: Store) -> None:
    found = json.loads(invoke("cache", "ls", "--cache", filled.root, "--json").out)["entries"]
    assert [row["product"] for row in found] == ["ramp", "blurred", "sum", "blurred", "sum"]
    assert found[0]["last_used"] >= found[0]["created"][:19]
    chosen = invoke("cache", "ls", "--product", "sum", "--cache", filled.root).out.splitlines()
    assert chosen[-1].startswith("2 entries, ")
    key = found[1]["key"]
    assert json.loads(invoke("cache", "ls", key[:12], "--cache", filled.root, "--json").out)["entries"][0]["key"] == key


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ls", "nothing"], ["'nothing'", "0 entries"]),
        (["ls", "--product", "none"], ["no entry", "is selected"]),
        (["verify", "--product", "none"], ["no entry", "is selected"]),
        (["trace", "x"], ["'x'", "0 entries"]),
        (["gc", "--unused-for", "often"], ["--unused-for 'often'", "30d"]),
        (["gc", "--max-size", "10"], ["--max-size '10'", "20GB"]),
        (["gc", "--keep", "motorcycl"], ["did you mean motorcycle?"]),
        (["gc", "--train"], ["--keep DATASET"]),
        (["gc", "--preset", "robust"], ["--keep DATASET"]),
        (["gc", "--keep", "motorcycle", "--preset", "robst"], ["did you mean robust?"]),
        (["import", "/none/x.tar"], ["/none/x.tar", "cannot be read"]),
        (["export", "/none/x.tar"], ["cannot write", "/none/x.tar"]),
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line(invoke: Invoke, filled: Store, arguments: list[str], words: list[str]) -> None:
    before = sorted(filled.root.rglob("*"))
    ran = invoke("cache", *arguments, "--cache", filled.root)
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1), ran
    assert [word for word in words if word not in ran.err] == []
    assert sorted(filled.root.rglob("*")) == before


def test_a_part_is_verified(invoke: Invoke, filled: Store) -> None:
    ran = invoke("cache", "verify", "--product", "sum", "--scene", "Toy", "--cache", filled.root)
    assert ran.out == "2 sound, 0 damaged, 0 in quarantine\n"


def test_the_sizes_of_a_cache_add_up(invoke: Invoke, filled: Store) -> None:
    found = json.loads(invoke("cache", "size", "--cache", filled.root, "--json").out)
    rest = ("quarantine", "drafts", "orphans", "bookkeeping")
    assert sum(found["products"].values()) + sum(found[name] for name in rest) == found["total"]
    assert found["bookkeeping"] > 0
    assert "records and sources" in invoke("cache", "size", "--cache", filled.root).out


def test_one_thing_is_no_things(invoke: Invoke, filled: Store) -> None:
    key = next(entry.key for entry in filled.entries() if entry.label["product"] == "ramp")
    assert invoke("cache", "ls", key, "--cache", filled.root).out.splitlines()[-1].startswith("1 entry, ")


def test_cleaning_shows_first_and_deletes_when_told(invoke: Invoke, filled: Store) -> None:
    shown = invoke("cache", "gc", "--unused-for", "0s", "--cache", filled.root)
    assert "would delete 5 things" in shown.out
    assert "add --yes" in shown.out
    assert len(list(filled.entries())) == 5
    assert "deleted 5 things" in invoke("cache", "gc", "--unused-for", "0s", "--yes", "--cache", filled.root).out
    assert list(filled.entries()) == []
    assert "nothing to delete" in invoke("cache", "gc", "--cache", filled.root).out


def test_entries_travel(invoke: Invoke, filled: Store, tmp_path: Path) -> None:
    archive, other = tmp_path / "x.tar", tmp_path / "other"
    out = invoke("cache", "export", archive, "--product", "sum", "--inputs", "--cache", filled.root).out
    assert out.startswith("wrote 5 entries")
    assert "5 entries checked: 5 added" in invoke("cache", "import", archive, "--cache", other).out
    assert list(Store(other).entries()) == list(filled.entries())


def test_the_chain_of_an_entry_is_told_and_drawn(invoke: Invoke, filled: Store, tmp_path: Path) -> None:
    (key, *_) = (entry.key for entry in filled.entries() if entry.recipe.stage == "sum")
    picture = tmp_path / "graph.svg"
    ran = invoke("cache", "trace", key[:10], "--graph", picture, "--cache", filled.root)
    assert [line.split(" of ")[0].strip() for line in ran.out.splitlines() if " of Toy" in line] == [
        "sum",
        "blurred",
        "ramp",
    ]
    named = ("<svg", "sum", "blurred", "ramp", key[:12], f"code {code_hash_of({'make_sum': '1f'})[:8]}")
    assert all(name in picture.read_text() for name in named)
    found = json.loads(invoke("cache", "trace", key, "--json", "--cache", filled.root).out)["provenance"]
    assert [each["product"] for each in found] == ["sum", "blurred", "ramp"]
    refused = invoke("cache", "trace", key, "--graph", tmp_path / "graph.txt", "--cache", filled.root)
    assert (refused.code, ".svg" in refused.err) == (2, True)


def test_what_was_deleted_since_is_said(filled: Store) -> None:
    from semidense.cache.upkeep.gc import collect, survey
    from semidense.cache.upkeep.limits import Limits

    (key, *_) = (entry.key for entry in filled.entries() if entry.recipe.stage == "sum")
    ramps = [
        item for item in survey(filled, Limits(seconds=-1)).items if item.entry and item.entry.recipe.stage == "ramp"
    ]
    collect(filled, ramps)
    chain_ = ancestry(filled, key)
    assert chain_[-1].entry is None
    assert "was deleted since" in list(tree_lines(chain_))[-1]


def test_entries_of_another_version_are_listed_as_such_and_cleaned(invoke: Invoke, tmp_path: Path) -> None:
    store = Store(tmp_path / "cache")
    recipe = Recipe("images", {"pipeline.sources": "1f"}, {}, {}, {})
    with store.begin(recipe, {"product": "images", "scene": "Teddy"}) as draft:
        draft.create_array("left", (1,), "int8", (1,), ("n",), {})
        draft.write("left", (slice(None),), np.zeros(1, np.int8))
        entry = draft.publish(0.0, {"versions": {"semidense-stereo": "0.1.0"}})
    rows = json.loads(invoke("cache", "ls", "--json", "--cache", store.root).out)["entries"]
    assert [row["settings"] for row in rows] == ["of version 0.1.0"]
    items = json.loads(invoke("cache", "gc", "--yes", "--json", "--cache", store.root).out)["items"]
    told = [(item["name"], item["reason"], item["deleted"]) for item in items]
    assert told == [(entry.key, "made by version 0.1.0, whose code is gone", True)]
    assert store.find(entry.key) is None
