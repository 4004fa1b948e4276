"""The cost volume against MC-CNN, accurate and fast: ``python -m benchmarks.cost_volume``.

The first figure is the ratio of the time from two views to their exact volume, on the same crop of Motorcycle, one
thread on both sides; the second that of the time to the raw map of a fast volume, on some rows of the scene. The table
below them has, on these rows, the time and the raw error (> 1 px, nonocc, what is not reported counted wrong) of this
project, MC-CNN fast with each of its back ends, and OpenCV's SGBM; and a picture.
"""

import sys
from collections.abc import Callable
from importlib import resources
from itertools import cycle
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.guided import Side, shipped_nets
from benchmarks.harness import FOLDER, PAIRS, Ratio, as_command, compare, median_seconds, report, timed, write
from benchmarks.peers import AccurateMatcher, PeerError
from semidense.datasets import Scene, open_dataset
from semidense.pipeline.figures.colours import LINES
from semidense.pipeline.figures.drawing import legend_below, new_figure
from semidense.pipeline.plan.shipped_weights import read_network, shipped_weights
from semidense.stages.baselines.declaration import SgmParams
from semidense.stages.baselines.sgm import match_semi_global
from semidense.stages.compute.precision import resolve
from semidense.stages.compute.threads import keep_one_thread
from semidense.stages.disparity.winner_takes_all import winner_take_all
from semidense.stages.matching.cost_volume import cost_volume
from semidense.stages.matching.declaration import CostVolumeParams
from semidense.stages.matching.descriptors.net import descriptor_net_from_parameters
from semidense.stages.matching.descriptors.volume import fast_cost_volume
from semidense.stages.matching.net import net_from_parameters
from semidense.stages.metrics.errors import raw_bad
from semidense.stages.transforms.channels import channels
from semidense.stages.transforms.gray import to_gray

FASTEST = "MC-CNN fast, onnx dw"
"""The quickest form of MC-CNN fast."""
PICTURE = Path("docs/pictures/matchers.png")
MARKERS = "osD^vPX"
"""One for each matcher, so that no two are told apart by their colours alone."""
Map = Callable[[], NDArray[np.float32]]


def main(
    rows: Annotated[int, typer.Option(help="rows of the scene that the matchers are compared on")] = 48,
    crop: Annotated[tuple[int, int, int], typer.Option(help="rows, columns, disparities for the ratio")] = (
        48,
        128,
        24,
    ),
    pairs: Annotated[int, typer.Option()] = PAIRS,
    install: Annotated[bool, typer.Option(help="install MC-CNN accurate into build/bench")] = True,
    dataset: Annotated[str, typer.Option(help="where the scene comes from")] = "motorcycle",
    picture: Annotated[Path, typer.Option()] = PICTURE,
) -> None:
    """Print the ratio and the table, write both as JSON, draw the picture."""
    keep_one_thread()
    scene = open_dataset(dataset).scenes[0].load()
    ratios = list(_against_accurate(scene, crop, pairs)) if install else []
    first = (scene.left.shape[0] - rows) // 2
    part = slice(first, first + rows)
    maps = _maps(scene, part)
    if FASTEST in maps:
        what = "fast cost volume and raw map, times MC-CNN fast (mccnn 1.4.1, ONNX)"
        ratios.append(compare(what, maps["this project, fast"], maps[FASTEST], 1, pairs=pairs))
    matchers = _measured(scene, part, maps, pairs)
    report("cost_volume", ratios)
    write("matchers", {"rows": rows, "matchers": matchers})
    table = Table("matcher", "seconds", "raw error, %", box=None)
    for name, found in matchers.items():
        table.add_row(name, f"{found['seconds']:.3g}", f"{found['raw_bad']:.1f}")
    Console(width=120).print(table)
    _draw(matchers, f"{scene.name}, {rows} rows", picture)


def _volume(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float32]:
    net = net_from_parameters(read_network(shipped_weights("matching_net", "exact"), {})["parameters"], 3)
    return cost_volume(net, channels(left, right), disparities, "auto")


def _guided_volume(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float16]:
    params = CostVolumeParams(d_min=disparities[0], d_max=disparities[-1], mode="guided", precision=resolve("auto"))
    side = Side(params, channels(left, right), range(left.shape[0]), shipped_nets())
    side()
    return side.volume


def _fast_volume(left: NDArray[np.uint8], right: NDArray[np.uint8], disparities: range) -> NDArray[np.float32]:
    net = descriptor_net_from_parameters(read_network(shipped_weights("descriptor_net", "exact"), {})["parameters"], 3)
    return fast_cost_volume(net, channels(left, right), disparities, "auto")


def _against_accurate(scene: Scene, crop: tuple[int, int, int], pairs: int) -> list[Ratio]:
    """Return the ratio to MC-CNN accurate; where that cannot be had, say so and return none."""
    height, width, count = crop
    first, left_of = 200, 300
    part = slice(first, first + height), slice(left_of, left_of + width)
    views = scene.left[part], scene.right[part]
    disparities = range(count)
    try:
        with AccurateMatcher(to_gray(views[0]), to_gray(views[1]), disparities, FOLDER / "peers") as other:
            _volume(*views, disparities), other.seconds()
            times = [(timed(lambda: _volume(*views, disparities)), other.seconds()) for _ in range(pairs)]
    except PeerError as error:
        print(error, file=sys.stderr)
        return []
    seconds = float(np.median([one for one, _ in times])), float(np.median([one for _, one in times]))
    what = "exact cost volume, times MC-CNN accurate (mccnn 1.2.5)"
    return [Ratio(what, tuple(other / one for one, other in times), 10, seconds=seconds)]


def _maps(scene: Scene, part: slice) -> dict[str, Map]:
    """Return what makes the raw map of some rows of the scene, by matcher."""
    left, right = scene.left[part], scene.right[part]
    gray = to_gray(left), to_gray(right)
    disparities = range(scene.disparities.minimum, scene.disparities.maximum + 1)
    sgm = SgmParams(d_min=disparities[0], d_max=disparities[-1])
    return {
        "this project, exact": lambda: winner_take_all(_volume(left, right, disparities), disparities[0]),
        "this project, guided": lambda: winner_take_all(_guided_volume(left, right, disparities), disparities[0]),
        "this project, fast": lambda: winner_take_all(_fast_volume(left, right, disparities), disparities[0]),
        **_fast_matchers(gray, disparities),
        "OpenCV SGBM, checked": lambda: match_semi_global(*gray, sgm, checked=True),
    }


def _measured(scene: Scene, part: slice, maps: dict[str, Map], pairs: int) -> dict[str, dict[str, float]]:
    """Return time and raw error of each matcher."""
    if scene.truth is None:
        raise typer.BadParameter("the scene has no ground truth")
    truth, mask = scene.truth.disparity[part], scene.truth.nonocc[part]
    return {
        name: {"raw_bad": raw_bad(made(), truth, mask, 1.0), "seconds": median_seconds(made, pairs)}
        for name, made in maps.items()
    }


def _fast_matchers(gray: tuple[NDArray[np.uint8], NDArray[np.uint8]], disparities: range) -> dict[str, Map]:
    """Return MC-CNN fast with each of its weights for Middlebury; none if the extra ``baselines`` is not installed."""
    try:
        from mc_cnn.run import run_mc_cnn_fast
    except ImportError:
        print("MC-CNN fast is missing: pip install 'semidense-stereo[baselines]' brings it", file=sys.stderr)
        return {}
    names = {
        "torch": "mc_cnn_fast_mb_weights.pt",
        "onnx int8": "mc_cnn_fast_int8_excl_01.onnx",
        "onnx dw": "mc_cnn_fast_dw.onnx",
    }

    def matcher(file: str) -> Map:
        weights = str(resources.files("mc_cnn") / "weights" / file)

        def made() -> NDArray[np.float32]:
            views = (np.pad(view.astype(np.float32), 5, mode="edge") for view in gray)
            costs = run_mc_cnn_fast(*views, -disparities[-1], -disparities[0], weights)
            return winner_take_all(np.ascontiguousarray(costs[..., ::-1], np.float32), disparities[0])

        return made

    return {f"MC-CNN fast, {name}": matcher(file) for name, file in names.items()}


def _draw(matchers: dict[str, dict[str, float]], title: str, path: Path) -> None:
    figure = new_figure(title)
    figure.set_size_inches(8, 5)
    axes = figure.subplots()
    styles = zip(cycle(LINES), cycle(MARKERS), matchers.items(), strict=False)
    for colour, marker, (name, found) in styles:
        style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 10, "markeredgecolor": "black"}
        axes.plot(found["seconds"], found["raw_bad"], linestyle="none", label=name, **style)
    axes.set(xscale="log", xlabel="time (s)", ylabel="wrong by more than 1 px\n(% of the nonocc pixels)")
    axes.set_ylim(0, 1.1 * max(found["raw_bad"] for found in matchers.values()))
    axes.grid(alpha=0.3)
    legend_below(figure, axes.get_legend_handles_labels()[0])
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


if __name__ == "__main__":
    as_command(main)
