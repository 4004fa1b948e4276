"""List the datasets that can be named, and the scenes of one."""

from rich.markup import escape
from rich.table import Table

from datasets import describe, open_dataset
from pipeline.console import print_json, results


def list_datasets(as_json: bool) -> None:
    """Print what DATASET can be."""
    rows = describe()
    if as_json:
        print_json({"datasets": [{"dataset": pattern, "about": about} for pattern, about in rows]})
        return
    table = Table("dataset", "what it is", box=None)
    for pattern, about in rows:
        table.add_row(pattern, about)
    results().print(table)


def list_scenes(dataset: str, as_json: bool) -> None:
    """Print the scenes of a dataset: size, disparities, split, whether there is a truth.

    Raises:
        DatasetError: if the dataset cannot be read.
    """
    scenes = open_dataset(dataset).scenes
    if as_json:
        rows = [
            {
                "scene": scene.name,
                "rows": scene.size[0],
                "columns": scene.size[1],
                "d_min": scene.disparities.minimum,
                "d_max": scene.disparities.maximum,
                "split": scene.split,
                "truth": scene.has_truth,
            }
            for scene in scenes
        ]
        print_json({"dataset": dataset, "scenes": rows})
        return
    table = Table("scene", "rows x columns", "disparities px", "split", "truth", box=None)
    for scene in scenes:
        size, bounds = f"{scene.size[0]} x {scene.size[1]}", f"{scene.disparities.minimum}..{scene.disparities.maximum}"
        table.add_row(escape(scene.name), size, bounds, scene.split, "yes" if scene.has_truth else "no")
    results().print(table)
