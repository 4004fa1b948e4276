"""Weights that stand in for trained networks and their calibration: those of the package, or a user's file."""

import hashlib
import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from semidense.datasets import DatasetError
from semidense.datasets.formats.files import read_bytes, user_path
from semidense.pipeline.plan.config import Config
from semidense.stages.catalog import STAGES
from semidense.stages.evaluation.calibration.declaration import CalibrationParams
from semidense.stages.matching.declaration import CostVolumeParams, Mode
from semidense.stages.stage import Array, Inputs, Stage, StageError

_LEARNT_FROM_MAPS = ("evaluation_net", "calibration")
"""Products with weights of their own for guided volumes: the errors of guided maps lie together in patches."""
_GENERAL = ("descriptor_net", "evaluation_net", "evidence_net", "calibration")
"""Products of the preset ``robust`` whose weights ``training.weights=general`` replaces."""
_CALIBRATED = ("confidence", "disparity", "costvolume")
"""Products that a calibration holds for, unless another stage makes one of them."""
TOLERANCES = (1.0, 2.0, 3.0)
"""Errors up to which a disparity is right for a calibration of the package, px. The first one is the usual one."""


@dataclass(frozen=True)
class Weights:
    """A file of weights.

    Attributes:
        product: what it stands in for.
        name: of the package's file; empty for a user's own.
        file: the user's own file.
        digest: sha256 of its bytes.
    """

    product: str
    name: str
    file: Path | None
    digest: str

    def read(self) -> bytes:
        """Return the file's bytes, whose hash is ``digest``.

        Raises:
            StageError: if the file cannot be read, or has changed since the run was planned.
        """
        data = _bytes_of(self.product, self.file) if self.file else weights_file(self.name).read_bytes()
        if hashlib.sha256(data).hexdigest() != self.digest:
            raise StageError(f"{self.file or self.name}: the weights have changed since the run was planned; run again")
        return data


def weights_stage(product: str) -> Stage:
    """Return the stage that reads a learnt product from a file instead of learning it."""
    form = "table" if product == "calibration" else "network"
    return Stage(product, (), STAGES[product].outputs, f"{__name__}:read_{form}")


def weights_of(config: Config, product: str) -> Weights:
    """Return the weights of a product that is not trained: the file that the configuration names, or the package's.

    Raises:
        StageError: if the file cannot be read, or this installation has none for such a configuration.
    """
    if file := config.choice("weights", product):
        return own_weights(product, user_path(file))
    confidence, disparity, costvolume = (config.choice("use", name) or name for name in _CALIBRATED)
    mode, general = config.of("costvolume", CostVolumeParams).mode, config.training.weights == "general"
    tolerance = config.of("calibration", CalibrationParams).tolerance
    return shipped_weights(product, mode, confidence, disparity, costvolume, general, tolerance)


def shipped_weights(
    product: str,
    mode: Mode,
    confidence: str = _CALIBRATED[0],
    disparity: str = _CALIBRATED[1],
    costvolume: str = _CALIBRATED[2],
    general: bool = False,
    tolerance: float = TOLERANCES[0],
) -> Weights:
    """Return the package's weights of a product, for volumes of a mode and what makes confidence, map and costs.

    ``tolerance``, px, is the largest error of a right disparity for a calibration.

    Raises:
        StageError: if this installation has none.
    """
    name = weights_name(product, mode, confidence, disparity, costvolume, general, tolerance)
    return Weights(product, name, None, weights_digest(name))


def own_weights(product: str, file: Path) -> Weights:
    """Return the weights in a user's file.

    Raises:
        StageError: if it cannot be read.
    """
    return Weights(product, "", file, hashlib.sha256(_bytes_of(product, file)).hexdigest())


def _bytes_of(product: str, file: Path) -> bytes:
    from semidense.stages.weights import LARGEST  # loads torch

    try:
        return read_bytes(file, LARGEST, DatasetError, "network")
    except ValueError as error:  # a DatasetError, or a path with a null byte
        raise StageError(f"weights.{product} = {error}") from None


def weights_name(
    product: str,
    mode: Mode,
    confidence: str = _CALIBRATED[0],
    disparity: str = _CALIBRATED[1],
    costvolume: str = _CALIBRATED[2],
    general: bool = False,
    tolerance: float = TOLERANCES[0],
) -> str:
    """Return the name of a product's shipped weights, for volumes of a mode and what makes confidence, map and costs.

    A calibration tells how often one kind of map is right at one kind of confidence, within one tolerance, and nothing
    about others.

    >>> weights_name("evaluation_net", "guided"), weights_name("matching_net", "guided")
    ('evaluation_net.guided', 'matching_net')
    >>> weights_name("descriptor_net", "fast", general=True)
    'general/descriptor_net'
    >>> weights_name("calibration", "fast", "evidence_confidence", "aggregated", general=True)
    'general/calibration.evidence_confidence.aggregated.fast'
    >>> weights_name("calibration", "guided", tolerance=3)
    'calibration.guided.3px'
    """
    others = [name for name in (confidence, disparity, costvolume) if name not in _CALIBRATED]
    own = general and product in _GENERAL
    if product == "calibration" and others:
        kind = [*others, mode]
    else:
        kind = ["guided"] if mode == "guided" and product in _LEARNT_FROM_MAPS and not own else []
    name = ("general/" if own else "") + ".".join([product, *kind])
    return _for_tolerance(name, tolerance) if product == "calibration" else name


def _for_tolerance(name: str, tolerance: float) -> str:
    return name if tolerance == TOLERANCES[0] else f"{name}.{tolerance:g}px"


def weights_file(name: str) -> Traversable:
    """Return the file of shipped weights.

    Raises:
        StageError: if this installation has none.
    """
    file = _file(name)
    if not file.is_file():
        raise StageError(_missing(name))
    return file


def _file(name: str) -> Traversable:
    return resources.files("semidense.stages") / "weights" / f"{name}.safetensors"


@cache
def weights_digest(name: str) -> str:
    """Return the sha256 of shipped weights."""
    return hashlib.sha256(weights_file(name).read_bytes()).hexdigest()


def read_network(weights: Weights, _: Inputs) -> dict[str, Array]:
    """Return a network as its training left it, checked."""
    from semidense.stages.weights import read_weights

    return {**read_weights(weights.product, weights.read())}


def read_table(weights: Weights, _: Inputs) -> dict[str, Array]:
    """Return a calibration, checked."""
    from semidense.stages.weights import tables

    return tables.read_table(weights.read())


def _listed(texts: list[str]) -> str:
    return " or ".join(filter(None, (", ".join(texts[:-1]), texts[-1])))


def _missing(name: str) -> str:
    """Return what is missing and what to do about it."""
    if found := re.fullmatch(r"(?P<others>.*?)\.(?P<px>\d[\d.e+-]*)px", name):
        known = [f"{px:g}" for px in TOLERANCES if _file(_for_tolerance(found["others"], px)).is_file()]
        if known:
            return (
                f"no calibration for errors of up to {found['px']} px comes with this installation: set "
                f"calibration.tolerance (--within) to {_listed(known)}, or give a calibration of your own "
                "(weights.calibration=FILE)"
            )
        name = found["others"]
    product, _, mode = name.rpartition("/")[2].partition(".")
    if product != "calibration":
        return f"no weights for {name} come with this installation: train them with --train"
    if mode not in ("", "guided"):
        return (
            f"no calibration of {mode.replace('.', ' and ')} comes with this installation: a wanted error and "
            "calibrated probabilities need one; give R or a density instead, take a preset as it is, or give a "
            "calibration of your own (weights.calibration=FILE)"
        )
    of_mode = f" MODE={mode}" if mode else ""
    return (
        "no calibration of such volumes comes with this installation: a wanted error and calibrated probabilities need "
        f"one; `make calibration DATA=DIR{of_mode}` makes it from Middlebury's training scenes"
    )
