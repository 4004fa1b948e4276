"""The configuration: one tree, one section a product, every field with its range and default.

Sources, later ones win: the defaults, a TOML file, ``section.field=value`` settings.
"""

import difflib
import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from semidense.pipeline.plan.errors import UsageError
from semidense.stages.baselines.declaration import (
    CcnnParams,
    CheckedParams,
    CostConfidenceParams,
    ForestParams,
    SgmParams,
    WindowParams,
)
from semidense.stages.disparity.declaration import DisparityParams, RefinedParams
from semidense.stages.evaluation.calibration.declaration import CalibrationParams
from semidense.stages.evaluation.declaration import ConfidenceParams, EvaluationNetParams, EvaluationSamplesParams
from semidense.stages.evaluation.filtering import SemidenseParams
from semidense.stages.matching.declaration import (
    CostVolumeParams,
    DescriptorNetParams,
    MatchingNetParams,
    MatchingSamplesParams,
)
from semidense.stages.stage import NoParams, Params
from semidense.stages.transforms.declaration import ChannelsParams


class TrainingParams(Params):
    """What is trained, and on what. In no key: the scenes and networks themselves are, by their content."""

    dataset: str | None = Field(
        None, description="dataset whose training scenes are learnt from; default: the dataset of the run"
    )
    shipped: tuple[Literal["matching_net", "descriptor_net"], ...] = Field(
        (), description="networks that a training takes as they come with the package"
    )


class Config(BaseModel):
    """Everything that can be set, by product."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    training: TrainingParams = TrainingParams()
    channels: ChannelsParams = ChannelsParams()
    matching_samples: MatchingSamplesParams = MatchingSamplesParams()
    matching_net: MatchingNetParams = MatchingNetParams()
    descriptor_net: DescriptorNetParams = DescriptorNetParams()
    costvolume: CostVolumeParams = CostVolumeParams()
    disparity: DisparityParams = DisparityParams()
    evaluation_samples: EvaluationSamplesParams = EvaluationSamplesParams()
    evaluation_net: EvaluationNetParams = EvaluationNetParams()
    confidence: ConfidenceParams = ConfidenceParams()
    calibration: CalibrationParams = CalibrationParams()
    semidense: SemidenseParams = SemidenseParams()
    refined: RefinedParams = RefinedParams()
    sgm: SgmParams = SgmParams()
    census: WindowParams = WindowParams()
    sncc: WindowParams = WindowParams()
    mc_cnn: CheckedParams = CheckedParams()
    mc_cnn_accurate: CheckedParams = CheckedParams()
    cost_confidence: CostConfidenceParams = CostConfidenceParams()
    o1_forest: ForestParams = ForestParams()
    ccnn_net: CcnnParams = CcnnParams()

    def section(self, product: str) -> Params:
        """Return the settings of a product; those of a product without any are empty."""
        return getattr(self, product, NoParams())

    @classmethod
    def load(cls, file: Path | None = None, settings: Iterable[str] = ()) -> Self:
        """Return the configuration that a TOML file and ``section.field=value`` settings describe.

        Raises:
            UsageError: if the file cannot be read, a name is unknown (the nearest is given) or a value
                is not of the field's type and range.
        """
        tree = _read_toml(file) if file else {}
        for setting in settings:
            _merge(tree, setting)
        _refuse_unknown(tree)
        try:
            return cls.model_validate(tree)
        except ValidationError as error:
            raise UsageError(one_line(error)) from None


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text())
    except RecursionError:
        raise UsageError(f"configuration {file}: it is nested too deeply") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"configuration {file}: {getattr(error, 'strerror', None) or error}") from None


def parse_setting(setting: str) -> tuple[str, str, str]:
    """Split ``section.field=value``.

    Raises:
        UsageError: if it has another form.
    """
    name, equals, value = setting.partition("=")
    section, dot, field = name.strip().partition(".")
    if not (equals and dot and section and field):
        raise UsageError(f"setting {setting!r}: write section.field=value, such as semidense.R=0.8")
    return section, field, value.strip()


def _merge(tree: dict[str, Any], setting: str) -> None:
    section, field, value = parse_setting(setting)
    if not isinstance(tree.setdefault(section, {}), dict):
        raise UsageError(f"configuration: [{section}] must be a table of fields")
    tree[section][field] = parse_value(value)


def parse_value(text: str) -> object:
    """Return what a setting's text means: JSON where it is JSON, several words where it has commas, else the text."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text.split(",") if "," in text else text


def _refuse_unknown(tree: Mapping[str, Any]) -> None:
    """Refuse the first unknown section or field, naming the nearest that exists."""
    for section, fields in tree.items():
        if section not in Config.model_fields:
            raise UsageError(f"configuration: no section {section!r}; {nearest(section, Config.model_fields)}")
        known = type(getattr(Config(), section)).model_fields
        if not isinstance(fields, Mapping):
            raise UsageError(f"configuration: [{section}] must be a table of fields, not {fields!r}")
        for field in fields:
            if field not in known:
                hint = nearest(field, known, f"{section}.")
                raise UsageError(f"configuration: {section} has no setting {field!r}; {hint}")


def nearest(name: str, known: Iterable[str], prefix: str = "") -> str:
    """Return a hint: the nearest known name, or all of them if none is near."""
    names = list(known)
    folded = {item.lower(): item for item in names}
    near = difflib.get_close_matches(name.lower(), folded, n=1, cutoff=0.5)
    if near:
        return f"did you mean {prefix}{folded[near[0]]}?"
    return f"there are {', '.join(prefix + item for item in names)}" if names else "it has no settings"


def one_line(error: ValidationError) -> str:
    """Return one line for the first thing that is wrong with a configuration."""
    first = error.errors(include_url=False)[0]
    name = ".".join(str(part) for part in first["loc"])
    more = f" ({error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"configuration: {name} = {first['input']!r}: {first['msg']}{more}"
