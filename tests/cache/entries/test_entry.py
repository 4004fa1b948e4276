import json
from dataclasses import replace
from typing import Any

import pytest

from semidense.cache.document import seal
from semidense.cache.entries.entry import Entry, File, Manifest
from semidense.cache.errors import DamagedEntry, InvalidRecipe
from semidense.cache.keys.recipe import Recipe

RECIPE = Recipe("square", {"m": "1f"}, {"n": 3}, {"images": "ab"}, {})
SHA = "0123456789abcdef" * 4
ENTRY = Entry(RECIPE.key, RECIPE, SHA, {"scene": "Teddy"}, "2025-01-01T00:00:00+00:00", 1.5, 10, {"torch": "2"})
FILES = (File("data.zarr/m/c/0", 3, SHA), File("data.zarr/zarr.json", 2, SHA))


def test_record_round_trips() -> None:
    assert Entry.from_bytes(RECIPE.key, ENTRY.to_bytes()) == ENTRY


def test_record_is_readable() -> None:
    record = json.loads(ENTRY.to_bytes())
    assert record["recipe"]["params"] == {"n": 3}
    assert record["label"] == {"scene": "Teddy"}


def test_manifest_round_trips() -> None:
    assert Manifest.from_bytes(Manifest(FILES).to_bytes()) == Manifest(FILES)


def test_manifest_digest_is_over_path_size_and_hash() -> None:
    manifest = Manifest(FILES)
    assert manifest.size == 5
    assert manifest.folders == {"data.zarr", "data.zarr/m", "data.zarr/m/c"}
    others = [(replace(FILES[0], path="data.zarr/m/c/1"), FILES[1]), (replace(FILES[0], size=4), FILES[1]), FILES[:1]]
    others.append((replace(FILES[0], sha256=SHA[::-1]), FILES[1]))
    assert len({manifest.digest, *(Manifest(files).digest for files in others)}) == 5


@pytest.mark.parametrize(
    "path",
    [
        pytest.param("/etc/passwd", id="absolute"),
        pytest.param("data.zarr/../../x", id="up and out"),
        pytest.param("../data.zarr/x", id="starts with up"),
        pytest.param("data.zarr/./x", id="dot"),
        pytest.param("data.zarr//x", id="empty part"),
        pytest.param("data.zarr/x/", id="ends with a slash"),
        pytest.param("data.zarr", id="the folder itself"),
        pytest.param("other/x", id="outside the data"),
        pytest.param("data.zarr/.hidden", id="hidden"),
        pytest.param("data.zarr\\x", id="backslash"),
        pytest.param("data.zarr/x\n", id="line end"),
        pytest.param("data.zarr/x\0", id="NUL"),
        pytest.param("data.zarr/é", id="not ASCII"),
        pytest.param("", id="empty"),
        pytest.param(3, id="not text"),
    ],
)
def test_manifest_refuses_paths_that_lead_elsewhere(path: object) -> None:
    with pytest.raises(DamagedEntry, match=r"not one inside an entry"):
        Manifest.from_bytes(seal("manifest", {"files": [[path, 3, SHA]]}))


@pytest.mark.parametrize(
    "content",
    [
        pytest.param({"files": [["data.zarr/x", -1, SHA]]}, id="negative size"),
        pytest.param({"files": [["data.zarr/x", True, SHA]]}, id="size not a number"),
        pytest.param({"files": [["data.zarr/x", 1.0, SHA]]}, id="size not whole"),
        pytest.param({"files": [["data.zarr/x", 1, SHA.upper()]]}, id="hash in capitals"),
        pytest.param({"files": [["data.zarr/x", 1, SHA[1:]]]}, id="hash cut"),
        pytest.param({"files": [["data.zarr/x", 1]]}, id="row cut"),
        pytest.param({"files": {"data.zarr/x": 1}}, id="not rows"),
        pytest.param({"files": [["data.zarr/b", 1, SHA], ["data.zarr/a", 1, SHA]]}, id="not sorted"),
        pytest.param({"files": [["data.zarr/a", 1, SHA], ["data.zarr/a", 1, SHA]]}, id="named twice"),
        pytest.param({}, id="no files"),
        pytest.param({"files": [], "more": 1}, id="unknown field"),
    ],
)
def test_manifest_refuses(content: dict[str, Any]) -> None:
    with pytest.raises(DamagedEntry, match=r"^the manifest is damaged: [^\n]+$"):
        Manifest.from_bytes(seal("manifest", content))


def content(**changed: object) -> bytes:
    fields = json.loads(ENTRY.to_bytes())
    fields = {name: value for name, value in fields.items() if name not in ("kind", "format", "checksum")}
    return seal("entry", {**fields, **changed})


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(content(recipe={**RECIPE.to_dict(), "params": {"n": 4}}), id="recipe edited, checksum made anew"),
        pytest.param(content(key="0" * 64), id="another key"),
        pytest.param(content(recipe="square"), id="recipe not an object"),
        pytest.param(content(recipe={"stage": "square"}), id="recipe cut"),
        pytest.param(content(digest="x"), id="digest not one"),
        pytest.param(content(label={"scene": 3}), id="label not text"),
        pytest.param(content(label=[]), id="label not a mapping"),
        pytest.param(content(extras=[]), id="extras not a mapping"),
        pytest.param(content(seconds="1"), id="seconds not a number"),
        pytest.param(content(size=1.5), id="size not whole"),
        pytest.param(content(created=0), id="time not text"),
        pytest.param(content(more=1), id="unknown field"),
        pytest.param(Manifest(FILES).to_bytes(), id="a manifest"),
        pytest.param(content()[:-30], id="truncated"),
        pytest.param(b"", id="empty"),
        pytest.param(bytes(len(content())), id="zeros"),
        pytest.param(b"\xff" + content()[1:], id="not text"),
    ],
)
def test_record_refuses(data: bytes) -> None:
    with pytest.raises(DamagedEntry, match=r"^the record of [0-9a-f]{64} is damaged: [^\n]+$"):
        Entry.from_bytes(RECIPE.key, data)


def test_the_record_of_another_key_is_refused() -> None:
    with pytest.raises(DamagedEntry, match="is the record of"):
        Entry.from_bytes("0" * 64, ENTRY.to_bytes())


def test_an_entry_has_its_recipe_s_key() -> None:
    with pytest.raises(InvalidRecipe, match=RECIPE.key):
        replace(ENTRY, key="0" * 64)


def test_provenance_is_json() -> None:
    provenance = ENTRY.provenance()
    assert json.loads(json.dumps(provenance)) == provenance
    assert {"key", "digest", "stage", "code", "params", "inputs", "created"} < set(provenance)
