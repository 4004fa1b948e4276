"""List the known datasets, what can be fetched, and the scenes of a dataset."""

from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from semidense.datasets import SceneSource, describe, open_dataset
from semidense.datasets.benchmarks.copies.catalogue import publications, state
from semidense.datasets.benchmarks.copies.publication import Publication
from semidense.pipeline.cli.console import print_json
from semidense.pipeline.results.text import bytes_text, print_table, results

_SPARE = ("page", "cite", "licence")


def list_datasets(data: Path, as_json: bool) -> None:
    """Print what DATASET can be, and what can be fetched into a folder of data."""
    rows, offered = describe(), publications().values()
    if as_json:
        known = [{"dataset": pattern, "about": about} for pattern, about in rows]
        print_json({"datasets": known, "publications": [_publication_row(each, data) for each in offered]})
        return
    table = Table("dataset", "what it is", box=None)
    for pattern, about in rows:
        table.add_row(escape(pattern), escape(about))
    print_table(table, results())
    _print_publications([_publication_row(each, data) for each in offered], data)


def _publication_row(each: Publication, data: Path) -> dict[str, Any]:
    return {
        "name": each.name,
        "here": state(each, data),
        "dataset": each.spec_of(data),
        "files": len(each.sources),
        "megabytes": each.megabytes,
        "licence": each.licence,
        "cite": each.cite,
        "page": each.home,
        "confirmed": each.confirmed,
    }


def _print_publications(rows: list[dict[str, Any]], data: Path) -> None:
    table = Table("fetch", "here", "size", "licence", "cite", "page", box=None)
    for column in table.columns:
        column.no_wrap = True
    for row in rows:
        size = bytes_text(row["megabytes"] * 1_000_000) if row["megabytes"] else "unknown"
        mark = "" if row["confirmed"] else " *"
        table.add_row(row["name"] + mark, row["here"], size, row["licence"], row["cite"], row["page"])
    console = results()
    console.print()
    print_table(table, console, _SPARE)
    console.print(f"here: in {data}; pipeline data fetch NAME --data DIR", style="dim", markup=False)
    if not all(row["confirmed"] for row in rows):
        console.print("* these addresses follow the pattern of the others and are not confirmed", style="dim")


def list_scenes(dataset: str, as_json: bool) -> None:
    """Print the scenes of a dataset: size, disparities, split, whether there is a truth.

    Raises:
        DatasetError: if the dataset cannot be read.
    """
    scenes = open_dataset(dataset).scenes
    if as_json:
        print_json({"dataset": dataset, "scenes": [_scene_row(scene) for scene in scenes]})
        return
    table = Table("scene", "rows x columns", "disparities px", "split", "truth", box=None)
    for column in table.columns[1:]:
        column.no_wrap = True
    for scene in scenes:
        size, bounds = f"{scene.size[0]} x {scene.size[1]}", f"{scene.disparities.minimum}..{scene.disparities.maximum}"
        table.add_row(escape(scene.name), size, bounds, scene.split, "yes" if scene.has_truth else "no")
    print_table(table, results())


def _scene_row(scene: SceneSource) -> dict[str, Any]:
    return {
        "scene": scene.name,
        "rows": scene.size[0],
        "columns": scene.size[1],
        "d_min": scene.disparities.minimum,
        "d_max": scene.disparities.maximum,
        "split": scene.split,
        "truth": scene.has_truth,
    }
