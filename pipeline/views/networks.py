"""Figures of trained networks: how they learnt."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from pipeline.views.colours import BLUE, QUIET, RED

_COIN = float(np.log(2))
"""The loss of a network that has learnt nothing, nats."""


def draw_network(figure: Figure, dataset: xr.Dataset) -> None:
    """Draw the loss of each training step."""
    figure.set_size_inches(10, 5)
    _draw_loss(figure.subplots(), dataset["loss"].values, dataset.attrs.get("params", {}))


def loss_name(params: Mapping[str, Any]) -> str:
    """Return what the loss of a network consists of, by the settings of its training; these may not be told.

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
