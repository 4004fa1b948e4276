"""What a run made or found."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from semidense.cache import Store
from semidense.pipeline.plan.errors import UsageError, nearest
from semidense.pipeline.plan.images_and_truth import MASK_KINDS
from semidense.pipeline.plan.plan import Made, Plan
from semidense.pipeline.plan.presets import DEFAULT
from semidense.pipeline.results.opening import open_product

if TYPE_CHECKING:
    import xarray as xr

_NAMED, _SHOWN = 3, 40
"""Scenes that are named in a line, and rows of a table, at most."""


@dataclass(frozen=True, repr=False)
class Result:
    """What a run made or found.

    Attributes:
        plan: as it was before the run.
        made: the result of each step, by its id.
        store: the cache.
        metrics: rows as promised to scripts; empty if the run stopped before ``metrics``.
        preset: the named settings that it started from.
    """

    plan: Plan
    made: Mapping[str, Made]
    store: Store
    metrics: list[dict[str, Any]] = field(default_factory=list)
    preset: str = DEFAULT

    def find(self, product: str, scene: str | None = None) -> Made:
        """Return the result of a product; of a scene, if there are several.

        Raises:
            UsageError: if there is none (the nearest is named), or several fit.
        """
        of_product = [made for made in self.made.values() if made.step.product == product]
        if not of_product:
            products = dict.fromkeys(made.step.product for made in self.made.values())
            raise UsageError(f"no {product} was made; {nearest(product, products)}")
        found = [made for made in of_product if scene in (None, made.step.scene, made.step.scene.rsplit("/", 1)[-1])]
        if not found:
            raise UsageError(f"{product} was not made of {scene}; {nearest(scene, _scenes(of_product))}")
        if len(found) != 1:
            names = _scenes(found)
            way = "name a scene" if len(names) > 1 else "they are of several variants, which ``made`` holds"
            told = f"{len(found)} results fit ({', '.join(names)})"
            raise UsageError(f"{product} of {scene or 'the only scene'}: {told}; {way}")
        return found[0]

    def open(self, product: str, scene: str | None = None) -> "xr.Dataset":
        """Return a product as a lazy dataset with coordinates, units and provenance; see ``open_product``."""
        return open_product(self.store, self.find(product, scene).key)

    def __repr__(self) -> str:
        """Return one line: how much was made and how much was there."""
        reused = sum(made.reused for made in self.made.values())
        scenes = dict.fromkeys(self.made[step_id].step.scene for step_id, _ in self.plan.targets)
        named = ", ".join([*scenes][:_NAMED]) + (f" and {len(scenes) - _NAMED} more" if len(scenes) > _NAMED else "")
        return f"<Result of {named}: {len(self.made) - reused} products made, {reused} reused>"

    def _repr_html_(self) -> str:
        """Return the figures as a table for a notebook; without figures, the products."""
        rows: list[dict[str, Any]] = [row for row in self.metrics if row["mask"] == "nonocc"]
        rows = rows or [
            {"product": made.step.product, "scene": made.step.scene, "seconds": f"{made.seconds:.2f}"}
            for made in self.made.values()
        ]
        head = list(dict.fromkeys(name for row in rows[:_SHOWN] for name in row))
        cells = [[_cell(row.get(name, "")) for name in head] for row in rows[:_SHOWN]]
        lines = ["".join(f"<td>{cell}</td>" for cell in row) for row in cells]
        body = "".join(f"<tr>{line}</tr>" for line in ["".join(f"<th>{escape(name)}</th>" for name in head), *lines])
        more = f"<p>and {len(rows) - _SHOWN} more rows</p>" if len(rows) > _SHOWN else ""
        return f"<p>{escape(repr(self))}</p><table>{body}</table>{more}"

    def mask_kinds(self) -> dict[str, str]:
        """Return where the non-occlusion mask of each scene comes from."""
        truths = [made for made in self.made.values() if made.step.product == "truth"]
        return {
            made.step.scene: MASK_KINDS[int(np.asarray(self.store.arrays(made.key)["mask_kind"][...])[0])]
            for made in truths
        }


def _scenes(made: Iterable[Made]) -> list[str]:
    return sorted({each.step.scene for each in made})


def _cell(value: object) -> str:
    return escape(f"{value:.4g}" if isinstance(value, float) else str(value))
