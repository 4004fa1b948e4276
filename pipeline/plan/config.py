"""The configuration: one section a product, every field with its range and default.

The sections are those of the stages' own ``Params``, of stages from other packages too. Sources, later ones win: the
defaults, a preset, a TOML file, ``section.field=value`` settings.
"""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from semidense.datasets import DatasetError
from semidense.datasets.formats.files import read_text
from semidense.pipeline.plan import presets
from semidense.pipeline.plan.arguments import texts
from semidense.pipeline.plan.errors import UsageError, nearest, shortened
from semidense.stages.catalog import STAGES
from semidense.stages.stage import NoParams, Params

P = TypeVar("P", bound=Params)
Settings = Mapping[str, object] | Iterable[str] | str | None
"""Settings as people type them: ``{"semidense.R": 0.8}``, ``"semidense.R=0.8"``, several of the latter, or none."""
_VALUE = re.compile(r'(?:\[[^\]]*\]|"[^"]*"|[^,])+')
"""One of several values."""
CHOICES = ("weights", "use")
"""Sections with a field a product, each empty by default."""

LONGEST_FILE = 1 << 20
"""Bytes of a configuration; no real one comes near."""


class TrainingParams(Params):
    """What is trained, and on what. In no key: the scenes and networks themselves are, by their content."""

    dataset: str | None = Field(
        None, description="dataset whose training scenes are used; default: the dataset of the run"
    )
    shipped: tuple[Literal["matching_net", "descriptor_net", "evaluation_net"], ...] = Field(
        (), description="networks that --train does not train but takes from the package"
    )
    weights: Literal["indoor", "general"] = Field(
        "indoor", description="the package's set: of 29 indoor scenes; or general, of these and 116 streets"
    )
    maps: int | None = Field(
        None, ge=2, description="most scenes of each data set whose maps are learnt from, spread evenly; default: all"
    )
    cross_fit: bool = Field(
        False, description="learn from maps that networks made which have not seen the scene: as wrong as new maps"
    )
    held_out: bool = Field(False, description="with --train: judge training scenes, by networks of other scenes")


class Config(BaseModel):
    """Everything that can be set. ``Config.load`` makes one: it has a section for each product that has settings.

    Beside the products' sections, ``training`` says what is learnt from, ``weights.PRODUCT`` names a file whose weights
    take the place of the package's, and ``use.PRODUCT=OTHER`` makes a product by the stage of another one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    training: TrainingParams = TrainingParams()

    def section(self, product: str) -> Params:
        """Return the settings of a product; those of a product without any are empty."""
        found: Params = getattr(self, product, NoParams())
        return found

    def of(self, product: str, kind: type[P]) -> P:
        """Return the settings of a product whose declaration is known.

        Raises:
            TypeError: if they are of another kind.
        """
        found = self.section(product)
        if not isinstance(found, kind):
            raise TypeError(f"the settings of {product} are {type(found).__name__}, not {kind.__name__}")
        return found

    def choice(self, section: str, product: str) -> str | None:
        """Return what one of ``CHOICES`` names for a product; None if nothing was chosen."""
        found: str | None = getattr(getattr(self, section), product, None)
        return found

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return all settings by section, as plain JSON types; of ``CHOICES`` those that were made or undone."""
        return {
            name: getattr(self, name).model_dump(mode="json", exclude_unset=name in CHOICES)
            for name in type(self).model_fields
        }

    @staticmethod
    def load(file: Path | None = None, settings: Iterable[str] = (), preset: str = presets.DEFAULT) -> "Config":
        """Return the configuration that a preset, a TOML file and ``section.field=value`` settings describe.

        Raises:
            UsageError: if the file cannot be read, a name is unknown (the nearest is given) or a value
                is not of the field's type and range.
        """
        tree = _read_file(file) if file else {}
        model = _model(tuple(STAGES))
        for setting in preset_settings(preset):
            _merge(tree, setting, model, over=False)
        for setting in settings:
            _merge(tree, setting, model)
        _refuse_unknown(tree, model)
        try:
            return model.model_validate(tree)
        except ValidationError as error:
            raise UsageError(one_line(error)) from None


@cache
def _model(products: tuple[str, ...]) -> type[Config]:
    """Return the model with a section for each of the products that has settings, and the sections of choices."""
    stages = [STAGES[product] for product in products]
    sections = {stage.product: stage.params for stage in stages if stage.params is not NoParams and not stage.section}
    sections["weights"] = _choices("weights", [stage.product for stage in stages if stage.learnt])
    sections["use"] = _choices("use", products)
    fields: dict[str, Any] = {name: (kind, kind()) for name, kind in sections.items()}
    return create_model("Config", __base__=Config, **fields)


def _choices(name: str, products: Iterable[str]) -> type[Params]:
    told = {
        "weights": "file with the weights of {}; default: those that come with the package",
        "use": "product whose stage makes {} instead of its own",
    }[name]
    fields: dict[str, Any] = {
        product: (str | None, Field(None, description=told.format(product))) for product in products
    }
    return create_model(name, __base__=Params, **fields)


def _read_file(file: Path) -> dict[str, Any]:
    """Return the sections of a TOML file, or of the JSON file that a run or a match wrote beside its results."""
    try:
        text = read_text(file, LONGEST_FILE, DatasetError, "configuration")
    except DatasetError as error:
        raise UsageError(f"configuration {error}") from None
    return _read_exported(file, text) if file.suffix == ".json" else _read_toml(file, text)


def _read_exported(file: Path, text: str) -> dict[str, Any]:
    """Return the settings of a ``config.json`` or ``summary.json``, as they were asked for."""
    try:
        found = [dict(each["sections"]) for each in json.loads(text)["configuration"]]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise UsageError(f"configuration {file}: it is no config.json or summary.json of this version") from None
    if not found or any(each != found[0] for each in found):
        raise UsageError(f"configuration {file}: it holds {len(found)} sets of settings that differ; give a TOML file")
    return found[0]


def _read_toml(file: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise UsageError(f"configuration {file}: it is nested too deeply") from None
    except ValueError as error:  # of a number with too many digits, a plain one
        raise UsageError(f"configuration {file}: {error}") from None


def setting_texts(settings: Settings) -> tuple[str, ...]:
    """Return settings as ``section.field=value``, as they are typed on the command line.

    >>> setting_texts({"semidense.R": 0.8, "channels.use": ["gray"], "costvolume.mode": "fast"})
    ('semidense.R=0.8', 'channels.use=["gray"]', 'costvolume.mode="fast"')
    >>> setting_texts("semidense.R=0.8")
    ('semidense.R=0.8',)

    Raises:
        UsageError: if they have another form, or a value is none that a configuration can hold.
    """
    if not isinstance(settings, Mapping):
        return texts("settings", settings)
    return tuple(f"{name}={value_text(name, value)}" for name, value in settings.items())


def value_text(name: str, value: object) -> str:
    """Return a setting's value as ``parse_value`` reads it: JSON.

    Raises:
        UsageError: if JSON has no such value.
    """
    try:
        return json.dumps(value, default=_plain)
    except (TypeError, ValueError):
        raise UsageError(
            f"setting {name} = {shortened(value)}: give a number, a text, true, false or a list of them"
        ) from None


def _plain(value: object) -> object:
    """Return a path, a tuple's kin or NumPy's number as JSON knows it."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError


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


def preset_settings(preset: str) -> tuple[str, ...]:
    """Return the settings of a preset that differ from the defaults.

    Raises:
        UsageError: if there is no preset of that name.
    """
    if not isinstance(preset, str) or preset not in presets.PRESETS:
        raise UsageError(f"no preset {preset!r}; {nearest(preset, presets.PRESETS)}")
    return presets.PRESETS[preset]


def _merge(tree: dict[str, Any], setting: str, model: type[Config], over: bool = True) -> None:
    """Put a setting into the tree; unless ``over``, only where the tree has none."""
    section, field, text = parse_setting(setting)
    if not isinstance(tree.setdefault(section, {}), dict):
        raise UsageError(f"configuration: [{section}] must be a table of fields")
    if over or field not in tree[section]:
        tree[section][field] = parse_value(text, several="tuple" in str(_annotation(model, section, field)))


def _annotation(model: type[Config], section: str, field: str) -> object:
    """Return the type of a setting; None if there is no setting of this name."""
    known = model.model_fields.get(section)
    found = getattr(known.annotation, "model_fields", {}).get(field) if known else None
    return found.annotation if found else None


def parse_value(text: str, several: bool = True) -> object:
    """Return what a setting's text means: JSON where it is JSON, else the text; of ``several``, its parts at commas."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):  # a number with too many digits is a plain ValueError
        return text.split(",") if several and "," in text else text


def alternatives(setting: str) -> list[str]:
    """Return ``section.field=v1,v2`` as one setting a value; commas in brackets and quotes belong to their value.

    >>> alternatives('channels.use=["gray","rank"],["gray"]')
    ['channels.use=["gray","rank"]', 'channels.use=["gray"]']
    """
    section, name, values = parse_setting(setting)
    return [f"{section}.{name}={value}" for value in _VALUE.findall(values) or [""]]


def _refuse_unknown(tree: Mapping[str, Any], model: type[Config]) -> None:
    """Refuse the first unknown section or field, naming the nearest that exists."""
    for section, fields in tree.items():
        if section not in model.model_fields:
            raise UsageError(f"configuration: no section {section!r}; {nearest(section, model.model_fields)}")
        known = model.model_fields[section].annotation.model_fields  # type: ignore[union-attr]
        if not isinstance(fields, Mapping):
            raise UsageError(f"configuration: [{section}] must be a table of fields, not {fields!r}")
        for field in fields:
            if field not in known:
                hint = nearest(field, known, f"{section}.")
                raise UsageError(f"configuration: {section} has no setting {field!r}; {hint}")


def one_line(error: ValidationError) -> str:
    """Return one line for the first thing that is wrong with a configuration."""
    first = error.errors(include_url=False)[0]
    name = ".".join(str(part) for part in first["loc"])
    more = f" ({error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"configuration: {name} = {shortened(first['input'])}: {first['msg']}{more}"
