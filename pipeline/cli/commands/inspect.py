"""Look at a cached product: its xarray, statistics, and a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from semidense.cache import Store
from semidense.pipeline.api import Task, status
from semidense.pipeline.cli.console import print_json, why
from semidense.pipeline.files.suggestion import run_command
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.plan import Planned
from semidense.pipeline.results.opening import open_product
from semidense.pipeline.results.text import opening_text, print_table

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Inspection:
    """A product that is there, opened lazily.

    Attributes:
        planned: its step, with its key.
        dataset: the product.
        store: the cache that holds it.
        truth: of a cost volume, the product ``truth`` of its scene; None if that is not cached.
    """

    planned: Planned
    dataset: "xr.Dataset"
    store: Store
    truth: "xr.Dataset | None" = None


def inspection(planned: Planned, store: Store, task: Task) -> Inspection:
    """Open a product for looking at it.

    Raises:
        UsageError: if it is not cached, with the command that makes it.
    """
    step = planned.step
    if planned.state != "hit" or planned.key is None:
        raise UsageError(
            f"{step.name} is not cached ({why(planned)}): make it with `{run_command(task, step.product)}`"
        )
    truth = _cached_truth(step.scene, store, task) if step.product == "costvolume" else None
    return Inspection(planned, open_product(store, planned.key), store, truth)


def _cached_truth(scene: str, store: Store, task: Task) -> "xr.Dataset | None":
    """Return the truth of a scene; None if it has none, or if it is not cached."""
    keys = [each.key for each in status(task, "truth").steps if _is_cached_truth(each, scene)]
    return open_product(store, keys[0]) if keys and keys[0] else None


def _is_cached_truth(planned: Planned, scene: str) -> bool:
    return (planned.step.product, planned.step.scene, planned.state) == ("truth", scene, "hit")


def draw(found: Inspection, png: Path, pixel: str | None, disparity: int | None) -> None:
    """Draw the product into a PNG file.

    Raises:
        UsageError: if the pixel or the disparity is not one of the product's.
    """
    from semidense.pipeline.figures.figure import figure, product_title
    from semidense.pipeline.files.writing import save_png

    step = found.planned.step
    place = None if pixel is None else _parse_pixel(pixel, found.dataset)
    title, truth = product_title(found.dataset), found.truth
    save_png(figure(step.product, found.dataset, title=title, pixel=place, disparity=disparity, truth=truth), png)


def _parse_pixel(text: str, dataset: "xr.Dataset") -> tuple[int, int]:
    try:
        y, x = (int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"pixel {text!r}: write Y,X such as 120,200") from None
    height, width = dataset.sizes.get("y", 0), dataset.sizes.get("x", 0)
    if not (0 <= y < height and 0 <= x < width):
        raise UsageError(f"pixel {text}: outside the image of {height} x {width} px")
    return y, x


def _draw_in_terminal(found: Inspection) -> None:
    """Draw a map below its figures, if it is one and stdout is a terminal that can show it."""
    from semidense.pipeline.cli.terminal import can_draw, draw_picture

    if can_draw(Console()):
        from semidense.pipeline.cli.terminal import small_picture

        picture = small_picture(found.planned.step.product, found.dataset)
        if picture:
            draw_picture(*picture)


def statistics(dataset: "xr.Dataset") -> list[dict[str, Any]]:
    """Return for each array: dims, dtype, least and largest value, mean, share of NaN; read a chunk at a time."""
    return [_array_statistics(str(name), array) for name, array in dataset.data_vars.items() if name != "probability"]


def _array_statistics(name: str, array: "xr.DataArray") -> dict[str, Any]:
    import dask
    import numpy as np

    shape = " x ".join(f"{dim} {length}" for dim, length in array.sizes.items())
    row: dict[str, Any] = {
        "name": name,
        "dims": shape,
        "dtype": str(array.dtype),
        "units": array.attrs.get("units", ""),
    }
    if array.size == 0:
        return row
    numbers = array.astype("float64")
    least, largest, mean, none = dask.compute(  # type: ignore[attr-defined, no-untyped-call]
        numbers.min(), numbers.max(), numbers.mean(), numbers.isnull().mean()
    )
    figures = {"min": float(least), "max": float(largest), "mean": float(mean), "none": float(none)}
    return row | {key: value for key, value in figures.items() if np.isfinite(value)}


def _number(value: float) -> str:
    """Return a value to four digits; a large one as a whole number.

    >>> _number(310290.0), _number(0.05618)
    ('310,290', '0.05618')
    """
    return f"{value:,.0f}" if 1e4 <= abs(value) < 1e12 else f"{value:.4g}"


def print_inspection(found: Inspection, png: Path | None, as_json: bool) -> None:
    """Print the xarray, a line of statistics an array, the picture's path, and how to open the product in Python."""
    import xarray as xr

    rows, step = statistics(found.dataset), found.planned.step
    if as_json:
        head = {"product": step.product, "scene": step.scene, "key": found.planned.key}
        print_json({**head, "arrays": rows, "png": str(png) if png else None})
        return
    console = Console(highlight=False, soft_wrap=True)
    with xr.set_options(display_width=console.width):  # type: ignore[no-untyped-call]
        console.print(repr(found.dataset.drop_attrs(deep=False)), markup=False)
    table = Table("array", "dims", "dtype", "min", "max", "mean", "none", "unit", box=None)
    for row in rows:
        figures = [_number(row[name]) if name in row else "-" for name in ("min", "max", "mean")]
        none = f"{100 * row['none']:.1f} %" if "none" in row else "-"
        table.add_row(row["name"], row["dims"], row["dtype"], *figures, none, row["units"])
    for column in table.columns:
        column.no_wrap = True
    for column in table.columns[3:7]:
        column.justify = "right"
    print_table(table, console, ("dims", "unit", "dtype"))
    _draw_in_terminal(found)
    if png:
        console.print(f"wrote {png}", markup=False)
    console.print(f"in Python: {opening_text(found.store.root, str(found.planned.key))}", markup=False)
