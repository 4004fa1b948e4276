"""Figures of what the two networks learn from."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from semidense.pipeline.figures.colours import BLUE, ORANGE, QUIET, RED, SKY
from semidense.pipeline.figures.drawing import disparity_scale, draw_classes, legend_below, none_patch, share_patch
from semidense.pipeline.results.opening import recorded
from semidense.stages.evaluation.declaration import STRIDE
from semidense.stages.evaluation.evidence.foreign.declaration import KINDS

_SHOWN = 6
"""Crops or grids in a figure."""
_MOST = 2000
"""Most samples that a figure reads; of more, this many at even distances."""
RIGHT = 1.0
"""Largest error of a pixel that is drawn as right, px."""
_CLASSES = {-1: ("unknown", QUIET), 0: ("wrong", RED), 1: ("right", BLUE)}
"""Name and colour of each label."""


def _thinned(dataset: xr.Dataset) -> xr.Dataset:
    """Return at most ``_MOST`` samples, over all of them."""
    return dataset.isel(sample=slice(None, None, -(-dataset.sizes["sample"] // _MOST))).load()


def _mosaic(figure: Figure, dataset: xr.Dataset, bars: int) -> dict[str, Axes]:
    """Return the axes ``first`` and ``second``, and below them ``shown-0`` ... where samples are more than a pixel."""
    crops = dataset.sizes["row"] * dataset.sizes["column"] > 1
    rows: list[Any] = [["first"] * (_SHOWN // 2) + ["second"] * (_SHOWN // 2)]
    rows += [[f"shown-{index}" for index in range(_SHOWN)]] * crops
    height = max(3.6, 0.17 * bars + 1.2)
    figure.set_size_inches(12.5, height + 2.6 * crops + 1)
    return figure.subplot_mosaic(rows, height_ratios=[height, 2.2][: len(rows)])


def draw_matching_samples(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw which disparities are learnt and from which scenes, and the truth of a few crops."""
    seen = _thinned(dataset)
    axes = _mosaic(figure, seen, _scenes(seen).size)
    _draw_disparities(axes["first"], seen)
    _draw_scenes(axes["second"], dataset)
    handles, _ = axes["second"].get_legend_handles_labels()
    if "shown-0" in axes:
        handles.append(_draw_crops([axes[f"shown-{index}"] for index in range(_SHOWN)], seen))
    legend_below(figure, handles)


def _scenes(dataset: xr.Dataset) -> NDArray[Any]:
    return np.unique(dataset["scene"].values)


def _draw_disparities(axes: Axes, seen: xr.Dataset) -> None:
    """Draw how often each disparity is true, and how often it is compared."""
    truth, compared = seen["truth"].values, seen["disparities"].values.ravel()
    known = truth[np.isfinite(truth)]
    everything = np.concatenate([known, compared])
    edges = np.arange(np.floor(everything.min()), np.ceil(everything.max()) + 2) - 0.5
    for values, label, style in (
        (known, "true, of the pixels in the samples", {"histtype": "stepfilled", "color": SKY}),
        (compared, "compared at", {"histtype": "step", "color": RED, "linewidth": 1.8}),
    ):
        axes.hist(values, edges.tolist(), weights=np.full(values.size, 100 / max(values.size, 1)), label=label, **style)
    axes.set(xlabel="disparity (px)", ylabel="share (%)", title=f"disparities of {seen.sizes['sample']:,} samples")
    axes.legend(fontsize="small")


def _draw_scenes(axes: Axes, dataset: xr.Dataset) -> None:
    """Draw how many samples each scene gives, upright and mirrored."""
    scene, mirrored = dataset["scene"].values, dataset["mirrored"].values.astype(bool)
    names = _scenes(dataset)
    start = np.zeros(names.size)
    for chosen, label, colour in ((~mirrored, "as they are", BLUE), (mirrored, "views mirrored and exchanged", ORANGE)):
        counts = np.array([np.count_nonzero(chosen & (scene == name)) for name in names])
        axes.barh(names, counts, left=start, color=colour, label=label)
        start += counts
    _finish_bars(axes, names, "samples", f"{scene.size:,} samples by training scene")


def _finish_bars(axes: Axes, names: NDArray[Any], quantity: str, title: str) -> None:
    axes.set(xlabel=quantity, ylabel="training scene (its place in the split)", title=title)
    axes.set_yticks(names)
    axes.invert_yaxis()


def _draw_crops(axes: list[Axes], seen: xr.Dataset) -> Patch:
    """Draw the truth of a few crops in one scale of disparities; return the legend's entry for what is missing."""
    shown = seen.isel(sample=slice(None, None, max(1, seen.sizes["sample"] // len(axes))))
    crops = shown["truth"].values[: len(axes)]
    scale = disparity_scale(crops, "truth (px)")
    for each, crop, scene in zip(axes, crops, shown["scene"].values, strict=False):
        picture = each.imshow(np.ma.masked_invalid(crop), cmap=scale.colours, vmin=scale.low, vmax=scale.high)
        each.set(title=f"crop of scene {scene}", xlabel="x (px)", ylabel="y (px)")
    for spare in axes[len(crops) :]:
        spare.set_axis_off()
    last = axes[len(crops) - 1]
    last.figure.colorbar(picture, cax=last.inset_axes((1.05, 0, 0.08, 1)), label=scale.label)
    return none_patch(crops, "teaches nothing (truth unknown or hidden), of these crops")


def draw_evaluation_samples(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the shares of right, wrong and unknown pixels, by scene and in all, and a few grids."""
    seen = _thinned(dataset)
    labels, scenes = seen["labels"].values, _scenes(seen)
    axes = _mosaic(figure, seen, scenes.size)
    _draw_shares(axes["first"], labels, seen["scene"].values, scenes)
    _draw_totals(axes["second"], labels)
    for index in range(_SHOWN if "shown-0" in axes else 0):
        _draw_grid(axes[f"shown-{index}"], seen, index * max(1, seen.sizes["sample"] // _SHOWN))
    legend_below(figure, [share_patch(labels == label, *about) for label, about in _CLASSES.items()])


def _draw_shares(axes: Axes, labels: NDArray[Any], scene: NDArray[Any], names: NDArray[Any]) -> None:
    start = np.zeros(names.size)
    for label, (_, colour) in _CLASSES.items():
        shares = np.array([100 * np.mean(labels[scene == name] == label) for name in names])
        axes.barh(names, shares, left=start, color=colour)
        start += shares
    _finish_bars(axes, names, "share of the pixels (%)", "labels by training scene")
    axes.set_xlim(0, 100)


def _draw_totals(axes: Axes, labels: NDArray[Any]) -> None:
    """Draw the number of pixels of each label."""
    names = [name for name, _ in _CLASSES.values()]
    counts = [int(np.count_nonzero(labels == label)) for label in _CLASSES]
    bars = axes.bar(names, counts, color=[colour for _, colour in _CLASSES.values()])
    axes.bar_label(bars, [f"{count:,}" for count in counts])
    axes.margins(y=0.15)
    axes.set(ylabel="pixels", title=f"labels of {len(labels):,} samples")


def _draw_grid(axes: Axes, seen: xr.Dataset, index: int) -> None:
    if index >= seen.sizes["sample"]:
        axes.set_axis_off()
        return
    draw_classes(axes, seen["labels"].values[index] + 1, [colour for _, colour in _CLASSES.values()])
    axes.set(
        title=f"grid of scene {int(seen['scene'][index])}", xlabel=f"column ({STRIDE} px)", ylabel=f"row ({STRIDE} px)"
    )


_COIN = float(np.log(2))
"""The loss of a coin's guess, nats."""


def draw_network(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the loss of each training step."""
    figure.set_size_inches(10, 5)
    _draw_loss(figure.subplots(), dataset["loss"].values, recorded(dataset, "params"))


def loss_name(params: Mapping[str, Any]) -> str:
    """Return the name of a network's loss, from the settings of its training if they are known.

    >>> loss_name({"ranking": 4.0}), loss_name({})
    ('class-balanced cross-entropy + 4 x ranking loss', 'class-balanced cross-entropy')
    >>> loss_name({"shipped": "0123"})
    'training loss'
    """
    if "shipped" in params:
        return "training loss"
    ranking = params.get("ranking", 0)
    return "class-balanced cross-entropy" + (f" + {ranking:g} x ranking loss" if ranking else "")


def _draw_loss(axes: Axes, loss: NDArray[np.float32], params: Mapping[str, Any]) -> None:
    window = loss.size // 20
    smooth = window > 1
    axes.plot(np.arange(1, loss.size + 1), loss, color=QUIET if smooth else BLUE, linewidth=0.9, label="each step")
    if smooth:
        steps = np.arange(window, loss.size + 1)
        axes.plot(steps, trailing_mean(loss, window), color=BLUE, linewidth=2, label=f"mean of the last {window} steps")
    # What a guess costs in the ranking loss depends on the disparities that are compared.
    if loss_name(params) == loss_name({}):
        axes.axhline(_COIN, color=RED, linestyle="--", linewidth=1.2, label="ln 2: a coin's guess")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(xlabel="training step", ylabel=f"{loss_name(params)} (nats, log scale)", xlim=(1, max(loss.size, 2)))
    axes.grid(alpha=0.3)
    axes.legend()


def trailing_mean(values: NDArray[np.float32], window: int) -> NDArray[np.float64]:
    """Return the mean of each value and the ``window - 1`` before it, from the first that has so many: float64.

    >>> trailing_mean(np.array([1, 3, 5], np.float32), 2).tolist()
    [2.0, 4.0]
    """
    return np.convolve(values.astype(np.float64), np.full(window, 1 / window), mode="valid")


def draw_foreign_samples(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw how many pixels of each kind of map are learnt from, and how many of them are wrong."""
    kind, error = dataset["kind"].values, dataset["error"].values.reshape(dataset.sizes["crop"], -1)
    all_of = np.bincount(kind, np.isfinite(error).sum(axis=1), len(KINDS))
    wrong_of = np.bincount(kind, (error > RIGHT).sum(axis=1), len(KINDS))
    axes = figure.add_subplot()
    places = range(len(KINDS))
    axes.barh(places, all_of, color=BLUE, label=f"right within {RIGHT:g} px")
    axes.barh(places, wrong_of, color=RED, label="wrong")
    axes.set_yticks(places, KINDS)
    axes.invert_yaxis()
    share = 100 * wrong_of.sum() / all_of.sum()
    axes.set(xlabel="pixels", title=f"{all_of.sum():,.0f} pixels by kind of map, {share:.1f} % wrong")
    axes.legend(fontsize="small")
