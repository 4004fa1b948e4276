"""Choose which results of a run are written as files, and name the files."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semidense.pipeline.files.file_names import safe_names
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.plan.steps import SPLIT
from semidense.pipeline.results.provenance import lineage
from semidense.pipeline.results.result import Result

_THRESHOLD = "semidense.R="
_STEMS = {"disparity": "disparity_raw", "semidense": "disparity"}
"""Names of files that are not the product's: as ``match`` has them, ``disparity`` is the map that is trusted."""


@dataclass(frozen=True)
class Wanted:
    """A result to write.

    Attributes:
        made: the result.
        stem: the start of its file's name; in a sweep with the settings that set it apart.
    """

    made: Made
    stem: str

    @property
    def product(self) -> str:
        """The name of its product."""
        return self.made.step.product


def wanted(result: Result, products: Sequence[str]) -> list[Wanted]:
    """Return the results of some products that stand behind what a run was asked for, scene by scene.

    Those of the scenes asked for and of the training split; not those of scenes that were only trained on, nor the
    networks of folds.
    """
    found: dict[tuple[str, str], dict[str, str]] = {}
    for step_id, variant in result.plan.targets:
        behind = lineage(result.made, step_id, over_training=True, up_to="calibration")
        split = [step for step in behind if step.scene == SPLIT]
        for step in [*split, *lineage(result.made, step_id)]:
            found.setdefault((step.scene, step.product), {}).setdefault(step.id, variant)
    found = {kind: _without_folds(variants) for kind, variants in found.items()}
    scenes = dict.fromkeys(scene for scene, _ in found)
    kinds = [(scene, product) for scene in scenes for product in products if (scene, product) in found]
    return [
        Wanted(result.made[step_id], stem)
        for scene, product in kinds
        for step_id, stem in _stems(result.made, product, found[scene, product]).items()
    ]


def _without_folds(variants: Mapping[str, str]) -> dict[str, str]:
    """Return the steps that are alone of their kind in their variant: of networks of folds there are several.

    >>> _without_folds({"step 1": "R=0.8", "step 2": "R=0.9", "step 3": "R=0.9"})
    {'step 1': 'R=0.8'}
    """
    counts = Counter(variants.values())
    return {step_id: variant for step_id, variant in variants.items() if counts[variant] == 1}


def _stems(made: Mapping[str, Made], product: str, variants: Mapping[str, str]) -> dict[str, str]:
    """Return the start of a file's name for each of the results of one product and scene."""
    stem = _STEMS.get(product, product)
    if len(variants) == 1:
        return dict.fromkeys(variants, stem)
    names = {step_id: f"{stem}-{_differences(made, step_id, variant)}" for step_id, variant in variants.items()}
    safe = safe_names(names.values())
    return {step_id: safe[name] for step_id, name in names.items()}


def _differences(made: Mapping[str, Made], step_id: str, variant: str) -> str:
    """Return those settings of a variant that the step depends on."""
    sections = {step.product for step in lineage(made, step_id, over_training=True)}
    settings = [setting for setting in variant.split(", ") if setting.partition(".")[0] in sections]
    return "-".join(_threshold(setting) if setting.startswith(_THRESHOLD) else setting for setting in settings)


def _threshold(setting: str) -> str:
    """Return ``semidense.R=0.9`` as ``R0.90``: files then sort by R."""
    value = float(setting.removeprefix(_THRESHOLD))
    return f"R{value:.2f}" if float(f"{value:.2f}") == value else f"R{value:g}"
