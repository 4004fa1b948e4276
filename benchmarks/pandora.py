"""Pandora's maps of the scenes of a dataset, in files that ``pipeline compare --map`` takes, and its confidences.

``python -m benchmarks.pandora middlebury:DIR/MiddEval3/trainingQ -o MAPS`` installs ``pandora``, libSGM and MC-CNN into
an environment of its own, matches each scene (MC-CNN fast, libSGM with the penalties that its plugin has for these
costs, V-fit, median, cross-checking) and writes

- ``SCENE.pfm``: the disparities; what the cross-checking rejects stays in, as in other dense maps;
- ``SCENE.checked.pfm``: those that passed it;
- ``SCENE.ambiguity.npy`` and ``SCENE.risk.npy``: its confidences (risk with the sign turned), higher is surer;

and prints the area under the error curve of both confidences. Then ``pipeline compare DATASET --map
"Pandora=MAPS/*.pfm"`` puts the maps and our score of them beside ours.
"""

import argparse
import json
import subprocess
import sys
import venv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers import PeerError
from semidense.datasets import SceneSource, open_dataset, write_pfm
from semidense.stages.metrics.ranking import ranked
from semidense.stages.transforms.gray import to_gray

REQUIREMENTS = ("pandora==1.9.0", "pandora_plugin_libsgm==1.5.8", "pandora_plugin_mccnn==1.3.8")
ENVIRONMENT = Path("build/pandora")
"""Where Pandora is installed, if no other folder is given."""
THRESHOLD = 1.0
PIPELINE = {
    "matching_cost": {"matching_cost_method": "mc_cnn"},
    "optimization": {"optimization_method": "sgm", "penalty": {"penalty_method": "mc_cnn_fast_penalty"}},
    "disparity": {"disparity_method": "wta", "invalid_disparity": "NaN"},
    "refinement": {"refinement_method": "vfit"},
    "filter": {"filter_method": "median"},
    "validation": {"validation_method": "cross_checking_accurate"},
}
"""Pandora's pipeline. With its default penalties, made for other costs, 24.9 % of MiddEval3 are wrong for 18.2."""
_PAIR = """
import json, sys, warnings
import numpy as np, rasterio
import pandora
from pandora.check_configuration import check_conf
from pandora.constants import Criteria
from pandora.img_tools import create_dataset_from_inputs
from pandora.state_machine import PandoraMachine
warnings.simplefilter("ignore")
folder, steps = sys.argv[1:]
given = np.load(f"{folder}/pair.npz")
first, last = map(int, given["disparities"])
for name in ("left", "right"):
    view = given[name].astype(np.float32)
    size = {"height": view.shape[0], "width": view.shape[1]}
    with rasterio.open(f"{folder}/{name}.tif", "w", driver="GTiff", count=1, dtype="float32", **size) as file:
        file.write(view, 1)
pandora.import_plugin()
machine = PandoraMachine()
costs, *others = json.loads(steps).items()
measures = {f"cost_volume_confidence.{name}": {"confidence_method": name} for name in ("ambiguity", "risk")}
pipeline = dict([costs, *measures.items(), *others])
views = {"left": {"img": f"{folder}/left.tif", "disp": [-last, -first]}, "right": {"img": f"{folder}/right.tif"}}
settings = check_conf({"input": views, "pipeline": pipeline}, machine)
settings["input"]["right"]["disp"] = [first, last]
left, right = (create_dataset_from_inputs(settings["input"][name]) for name in ("left", "right"))
found, _ = pandora.run(machine, left, right, settings)
measures = found["confidence_measure"]
np.savez(
    f"{folder}/found.npz",
    disparity=-found["disparity_map"].values,
    valid=(found["validity_mask"].values & int(Criteria.PANDORA_MSK_PIXEL_INVALID)) == 0,
    ambiguity=measures.sel(indicator="confidence_from_ambiguity.ambiguity").values,
    risk=-measures.sel(indicator="confidence_from_risk_max.risk").values,
)
"""


def environment(folder: Path) -> Path:
    """Return the Python of an environment with Pandora in it, which is made at the first call.

    Raises:
        PeerError: if pip cannot install it.
    """
    python, complete = folder / "bin" / "python", folder / ".complete"
    if not complete.exists():
        venv.create(folder, with_pip=True)
        done = subprocess.run(
            [python, "-m", "pip", "install", "--quiet", *REQUIREMENTS], capture_output=True, text=True
        )
        if done.returncode:
            raise PeerError(f"Pandora cannot be installed: {(done.stderr.strip() or 'pip fails').splitlines()[-1]}")
        complete.touch()
    return python


def match(python: Path, scene: SceneSource, folder: Path) -> dict[str, NDArray[np.float32]]:
    """Return Pandora's disparities, px, NaN none, before and after cross-checking, and its two confidences.

    Raises:
        PeerError: if it does not run.
    """
    left, right = (to_gray(view) for view in scene.load_images())
    folder.mkdir(parents=True, exist_ok=True)
    bounds = np.array([scene.disparities.minimum, scene.disparities.maximum])
    np.savez(folder / "pair.npz", left=left, right=right, disparities=bounds)
    done = subprocess.run([python, "-c", _PAIR, folder, json.dumps(PIPELINE)], capture_output=True, text=True)
    if done.returncode:
        raise PeerError(f"Pandora fails on {scene.name}: {(done.stderr.strip() or 'no word').splitlines()[-1]}")
    with np.load(folder / "found.npz") as found:
        disparity = found["disparity"].astype(np.float32)
        checked = np.where(found["valid"], disparity, np.float32(np.nan))
        return {"disparity": disparity, "checked": checked, "ambiguity": found["ambiguity"], "risk": found["risk"]}


def write(found: dict[str, NDArray[np.float32]], name: str, folder: Path) -> None:
    """Write the maps as PFM and the confidences as NumPy files."""
    write_pfm(folder / f"{name}.pfm", found["disparity"])
    write_pfm(folder / f"{name}.checked.pfm", found["checked"])
    for measure in ("ambiguity", "risk"):
        np.save(folder / f"{name}.{measure}.npy", found[measure])


def figures(scene: SceneSource, found: dict[str, NDArray[np.float32]]) -> list[float]:
    """Return the error of the dense map, %, nonocc, and the area under the error curve of each confidence."""
    truth = scene.load().truth
    if truth is None:
        return [np.nan] * 3
    by_measure = [
        ranked(found["disparity"], found[measure], truth.disparity, truth.nonocc)[THRESHOLD]
        for measure in ("ambiguity", "risk")
    ]
    return [by_measure[0]["raw_bad"], *(each["auc"] for each in by_measure)]


def main() -> int:
    """Match the scenes and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the maps")
    parser.add_argument("--environment", type=Path, default=ENVIRONMENT, help="where Pandora is installed")
    given = parser.parse_args()
    try:
        rows = _all(given.dataset, environment(given.environment.absolute()), given.output)
    except PeerError as error:
        print(f"benchmarks.pandora: {error}", file=sys.stderr)
        return 2
    print(_line("mean", *np.nanmean(rows, axis=0)))
    return 0


def _line(name: str, wrong: float, ambiguity: float, risk: float) -> str:
    return f"{name:20} {wrong:7.1f} {ambiguity:10.4f} {risk:10.4f}"


def _all(dataset: str, python: Path, folder: Path) -> list[list[float]]:
    rows = []
    print(f"{'scene':20} {'wrong %':>7} {'ambiguity':>10} {'risk':>10}")
    for scene in open_dataset(dataset).scenes:
        name = scene.name.rsplit("/", 1)[-1]
        found = match(python, scene, folder / "work" / name)
        write(found, name, folder)
        rows.append(figures(scene, found))
        print(_line(name, *rows[-1]), flush=True)
    return rows


if __name__ == "__main__":
    raise SystemExit(main())
