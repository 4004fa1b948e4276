"""Write what a run made as files that other programs read: maps, pictures, weights, figures, the configuration.

::

    FOLDER/
        config.json                     what was asked for and with which settings each result was made
        metrics.csv                     the rows of the figures
        matching_net.safetensors        of trained networks; also evaluation_net.safetensors
        calibration.safetensors         what the confidence was measured to be worth, if it was asked for
        SCENE/
            disparity.pfm               trusted disparities, px; infinity: none; of a sweep disparity-R0.90.pfm ...
            disparity-colour.png        the same in colours, black: none
            disparity_raw.pfm           raw disparities, before any was dropped; and disparity_raw-colour.png
            confidence.pfm              probability that the raw disparity is right; and confidence-colour.png

Where the variants of a sweep differ in a file's content, the settings that it depends on are in its name.
"""

import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from semidense.datasets.formats.atomic import atomic_write
from semidense.datasets.formats.pfm import write_pfm
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.figures.colours import confidence_rgb, disparity_rgb, disparity_span
from semidense.pipeline.files.file_names import safe_names
from semidense.pipeline.files.publishing import publishing, read_record, require_place, written_before
from semidense.pipeline.files.selection import Wanted, wanted
from semidense.pipeline.files.writing import explaining, save_png, table_text, write_rgb
from semidense.pipeline.plan.plan import Made
from semidense.pipeline.results.metric_rows import THRESHOLD
from semidense.pipeline.results.provenance import lineage
from semidense.pipeline.results.result import Result
from semidense.stages.catalog import STAGES
from semidense.stages.metrics.stage import ROW

COLUMNS = ("scene", "method", "mask", "threshold_px", "R", "pixels", *ROW)
"""The columns of ``metrics.csv``: the keys of the rows that are promised to scripts."""
CONFIG = "config.json"
"""The record of an export."""
_SWEEP = "sweep.json"
"""The record of a sweep."""
_MAPS = ("disparity", "confidence", "semidense")
_METRICS = "metrics.csv"
_MAP = re.compile(r"([^/.][^/]*)/(disparity|confidence)[^/]*(\.pfm|-colour\.png)")
"""Names of maps and their pictures, and the folder of their scene: no record makes an export delete others."""
_LAST = 50
"""Training steps that the final loss is a mean of."""
_Span = tuple[float, float]


def require_run_place(folder: Path, upto: str) -> None:
    """Refuse a folder for the results of a run up to a product before it is made; see ``publishing.require_place``."""
    require_place(folder, CONFIG, {CONFIG, *([_METRICS] if upto == "metrics" else [])})


def require_sweep_place(folder: Path) -> None:
    """Refuse a folder for a sweep before it is made; see ``publishing.require_place``."""
    require_place(folder, _SWEEP, {"sweep.csv", "sweep.png", _SWEEP})


def export(result: Result, folder: Path) -> list[Path]:
    """Write the results of a run into a folder, all of them or nothing; those of an earlier export are replaced.

    Of the scenes of this export no older file stays, nor do older figures. Maps of other scenes and networks stay, and
    ``config.json`` says of each scene how its maps were made.

    Args:
        result: of a run or a sweep. Scenes that were only trained on are left out.
        folder: made if it is missing. Names of scenes are never taken for paths: what is unusual in them is
            replaced, so that every file lies in this folder.

    Returns:
        The files, in the order in which they were written.

    Raises:
        UsageError: if the folder is a file, cannot be written, or holds a file that would be replaced and that no
            earlier export wrote.
        CacheError: if a result is no longer in the cache.
    """
    folder = Path(folder)
    before, ours = written_before(folder, CONFIG), {*_folders(result).values()}
    obsolete = {name for name in before if name == _METRICS or ((map_ := _MAP.fullmatch(name)) and map_[1] in ours)}
    with publishing(folder, CONFIG, _read_files(result), obsolete) as draft:
        exporter = _Exporter(result, draft)
        exporter.write_networks()
        exporter.write_maps()
        exporter.write_metrics()
        kept = sorted(name for name in before - obsolete if (folder / name).is_file())
        exporter.write_config(kept, [each for each in _described_before(folder) if each.get("folder") not in ours])
    return [folder / path.relative_to(draft) for path in exporter.written]


def _folders(result: Result) -> dict[str, str]:
    """Return the folder of each scene that was asked for."""
    return safe_names(result.made[step_id].step.scene for step_id, _ in result.plan.targets)


def _described_before(folder: Path) -> list[dict[str, Any]]:
    """Return what the record of an earlier export says of its results; nothing without a record."""
    found = read_record(folder, CONFIG).get("configuration")
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def _read_files(result: Result) -> list[Path]:
    """Return the files of the scenes that a run read."""
    return [path for made in result.made.values() for path in getattr(made.step.argument, "files", {}).values()]


@dataclass
class _Exporter:
    """One export: what was found in the result, and the files written so far."""

    result: Result
    folder: Path
    written: list[Path] = field(default_factory=list)
    _spans: dict[str, _Span] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Find what there is, and name the scenes' folders."""
        self.found = wanted(self.result, (*_MAPS, *_learnt()))
        self.scenes = _folders(self.result)

    def write_networks(self) -> None:
        """Write the trained networks and their calibration; shipped ones are files already."""
        for each in self.found:
            if each.product in _learnt() and each.made.step.inputs:
                self._write(self.folder / f"{each.stem}.safetensors", _weights(self.result, each.made))

    def write_maps(self) -> None:
        """Write the maps of every scene, as numbers and in colours."""
        for each in self.found:
            if each.product in _MAPS:
                self._write_map(each)

    def _write_map(self, each: Wanted) -> None:
        folder = self.folder / self.scenes[each.made.step.scene]
        folder.mkdir(exist_ok=True)
        values = self._read(each.made, "confidence" if each.product == "confidence" else "disparity")
        pfm, png = (folder / f"{each.stem}{end}" for end in (".pfm", "-colour.png"))
        write_pfm(pfm, values)
        colours = confidence_rgb(values) if each.product == "confidence" else disparity_rgb(values, *self._span(each))
        write_rgb(colours, png)
        self.written += [pfm, png]

    def _span(self, each: Wanted) -> _Span:
        """Return the span of colours: that of the raw map, so that raw and filtered pictures compare."""
        raw = next(step for step in lineage(self.result.made, each.made.step.id) if step.product == "disparity")
        if raw.id not in self._spans:
            self._spans[raw.id] = disparity_span(self._read(self.result.made[raw.id], "disparity"))
        return self._spans[raw.id]

    def _read(self, made: Made, name: str) -> Any:  # noqa: ANN401
        return self.result.store.arrays(made.key)[name][...]

    def write_metrics(self) -> None:
        """Write the rows of the figures, if the run went so far."""
        if self.result.metrics:
            path = self.folder / _METRICS
            write_rows(self.result.metrics, path)
            self.written.append(path)

    def write_config(self, kept: Sequence[str], described: Sequence[dict[str, Any]]) -> None:
        """Write the command, the versions, the settings that each result was made with, and the names of the files.

        Args:
            kept: files of earlier exports that stay.
            described: what the earlier record says of scenes that are not of this export.
        """
        targets = [*described, *(self._described(*target) for target in self.result.plan.targets)]
        files = {path.relative_to(self.folder).as_posix() for path in self.written} | {CONFIG, *kept}
        settings = {"preset": self.result.preset, "configuration": targets}
        document = provenance(sys.argv) | settings | {"files": sorted(files)}
        self._write(self.folder / CONFIG, (json.dumps(document, indent=2) + "\n").encode())

    def _described(self, step_id: str, variant: str) -> dict[str, Any]:
        """Return a result's configuration as it was asked for; settings and keys of it and of what it was made from."""
        target = self.result.made[step_id].step
        steps = {step.product: step for step in reversed(lineage(self.result.made, step_id))}
        return {
            "product": target.product,
            "scene": target.scene,
            "folder": self.scenes[target.scene],
            "variant": variant,
            "sections": target.asked,
            "settings": {product: step.settings for product, step in steps.items()},
            "keys": {product: self.result.made[step.id].key for product, step in steps.items()},
        }

    def _write(self, path: Path, data: bytes) -> None:
        with explaining(path), atomic_write(path) as file:
            file.write(data)
        self.written.append(path)


def _learnt() -> list[str]:
    return [stage.product for stage in STAGES.values() if stage.learnt]


def _weights(result: Result, made: Made) -> bytes:
    """Return the file of a trained network or a calibration; its metadata tell how it was made, and from what."""
    from semidense.stages.weights import save_weights
    from semidense.stages.weights.tables import save_table

    entry = result.store.require(made.key)
    steps = {step.product: step for step in lineage(result.made, made.step.id, over_training=True) if step.stage.inputs}
    metadata = {
        "configuration": {product: step.settings for product, step in steps.items()},
        "training_data": entry.recipe.inputs,
        "versions": entry.extras.get("versions", {}),
        "key": entry.key,
    }
    arrays = result.store.read(made.key)
    if made.step.product == "calibration":
        return save_table(arrays, metadata)
    loss = {"loss": float(np.mean(arrays["loss"][-_LAST:], dtype=np.float64)), "steps": int(arrays["loss"].size)}
    return save_weights(made.step.product, arrays, metadata | loss)


def write_rows(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write metrics rows as CSV with the columns ``COLUMNS``; what does not apply is empty.

    A last column ``variant`` is added only where rows of a sweep cannot be told apart without it.

    Raises:
        UsageError: if the file cannot be written.
    """
    named = {tuple(row.get(name) for name in COLUMNS[:5]) for row in rows}
    columns = COLUMNS if len(named) == len(rows) else (*COLUMNS, "variant")
    with explaining(path), atomic_write(path) as file:
        file.write(table_text(rows, columns).encode())


def write_sweep(rows: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """Write ``sweep.csv`` with every row, ``sweep.png`` with the curve and ``sweep.json``; return their paths.

    Where no threshold keeps a pixel, or another wish than R decides, there is no curve, and no picture.
    ``sweep.json`` tells command and versions, and names the files.

    Raises:
        UsageError: if the folder cannot be written, or holds a file of these names that no earlier sweep wrote.
    """
    from semidense.pipeline.figures.curves import error_curve_figure  # Matplotlib takes a second to load

    with publishing(folder, _SWEEP, obsolete={"sweep.png"}) as draft:
        write_rows(rows, draft / "sweep.csv")
        names = ["sweep.csv"]
        if any("bad" in row and "R" in row for row in rows):
            save_png(error_curve_figure(rows, threshold=THRESHOLD), draft / "sweep.png")
            names.append("sweep.png")
        names.append(_SWEEP)
        document = provenance(sys.argv) | {"files": names}
        (draft / _SWEEP).write_text(json.dumps(document, indent=2) + "\n")
    return [folder / name for name in names]
