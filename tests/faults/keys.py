"""Row 9: change each setting, input byte and source token: a key changes exactly when the result may."""

import io
import keyword
import random
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from annotated_types import Ge, Gt, Le, Lt

from semidense.cache.keys.trees import source_hash
from semidense.datasets.scene import DisparityRange, SceneSource
from semidense.pipeline.plan.building import build
from semidense.pipeline.plan.config import CHOICES, Config
from semidense.pipeline.plan.steps import Graph, Request, products
from semidense.stages.catalog import STAGES
from semidense.stages.compute.precision import resolve
from tests.faults.tally import Tally

PROJECT = Path(__file__).parents[2]
FOLDERS = ("pipeline", "stages", "datasets", "cache")
PER_MODULE, QUICK_PER_MODULE = 40, 4
"""Tokens and line ends of each module that are changed, and those of the quick form."""
Place = tuple[int, int, int, str]
"""A line's number, the columns between which its text is replaced, and the new text."""


def changed_ingredients(scale: float) -> Tally:
    """Change settings, bytes of input files, tokens of sources; and comments, which must change nothing."""
    tally = Tally()
    _settings(tally)
    _input_bytes(tally, 1 if scale >= 1 else 97)
    _sources(tally, PER_MODULE if scale >= 1 else QUICK_PER_MODULE)
    return tally


def keys_of(graph: Graph) -> dict[str, str]:
    """Return a stand-in for each product's key by product: its recipe, with its inputs' stand-ins for digests.

    Of several steps of a product the first counts: the others are of the folds of a calibration.
    """
    found: dict[str, str] = {}
    for step in graph.steps.values():
        found[step.id] = step.recipe(found).key
    return {step.product: found[step.id] for step in reversed(graph.steps.values())}


def _request(config: Config, train: bool) -> Request:
    from semidense.datasets import open_dataset

    dataset = open_dataset("synthetic:train=2,test=1,height=64,width=80,disparities=8")
    training = tuple(scene for scene in dataset.scenes if scene.split == "train") if train else ()
    return Request(dataset.select(["test-0"]), {"": config}, "metrics", train, training)


@cache
def below(product: str) -> frozenset[str]:
    """Return a product and all that is made from it, as the stages declare for the default settings."""
    found = {product}
    for stage in STAGES.values():
        if found & set(getattr(stage.params(), "inputs", stage.inputs)):
            found.add(stage.product)
    return frozenset(found)


def _settings(tally: Tally) -> None:
    """Change each field of each section to another valid value."""
    light = [f"{name}.relight=0" for name, net in Config.load() if hasattr(net, "relight")]  # a raw gray has no other
    base = Config.load(None, light)
    before = keys_of(build(_request(base, train=True)))
    for section in type(base).model_fields:
        params = getattr(base, section)
        for name, field in type(params).model_fields.items():
            for value in _others(field, getattr(params, name)):
                try:
                    config = Config.load(None, [*light, f"{section}.{name}={value}"])
                    after = keys_of(build(_request(config, train=True)))
                except ValueError:
                    continue
                if getattr(config, section) == params:
                    continue
                tally.injected += 1
                changed = {product for product in before.keys() & after.keys() if before[product] != after[product]}
                reached = _reached(section, name) & set(before)  # not products that are made only when asked for
                expected = reached if _may_matter(section, name, value) else frozenset()
                if changed != expected:
                    tally.fail("wrong", f"{section}.{name}={value} changes the keys of {sorted(changed ^ expected)}")
                break
            else:
                if section not in ("training", *CHOICES):
                    tally.fail("wrong", f"{section}.{name}: no other valid value was found")


def _reached(section: str, name: str) -> frozenset[str]:
    """Return the products that may depend on a setting."""
    if (section, name) == ("training", "cross_fit"):  # the first right map is then one by the networks of a fold
        return below("evaluation_samples") | {"right_disparity"}
    return below(section)


def _may_matter(section: str, name: str, value: object) -> bool:
    """Return whether a result may depend on a setting; the default precision is the one that this CPU is fast in."""
    if name == "precision":
        transformed = getattr(Config.load().section(section), "transformed", False)
        usual = resolve("auto", transformed=transformed)
        return resolve(str(value), transformed=transformed) != usual  # type: ignore[arg-type]
    if section == "costvolume" and name == "votes":
        return False  # of the guided volume only
    return (section in products() and name != "checkpoint_steps") or (section, name) == ("training", "cross_fit")


def _others(field: Any, value: object) -> Iterator[object]:  # noqa: ANN401
    """Yield values that a field may take and does not have."""
    from typing import get_args

    yield from (choice for choice in get_args(field.annotation) if isinstance(choice, str) and choice != value)
    if isinstance(value, bool):
        yield "false" if value else "true"
    elif isinstance(value, (int, float)):
        for bound in field.metadata:
            if isinstance(bound, (Ge, Gt, Le, Lt)):
                limit = next(iter(vars(bound).values())) if hasattr(bound, "__dict__") else None
                yield from [limit] if limit is not None and limit != value else []
        yield from (value + 2, value + 1, value - 1, value - 2, value / 2, value * 2)
    elif isinstance(value, (tuple, list)):
        yield from (",".join(map(str, value[:-1])), ",".join(map(str, value[:1])))
    yield from (1, 2, 3, 0.5, "x", "[0, 1]")


def _input_bytes(tally: Tally, stride: int) -> None:
    """Change each byte of an image file and of a truth, one at a time."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, length in (("left", 700), ("right", 700), ("truth", 400)):
            (folder / file).write_bytes(random.Random(file).randbytes(length))
        files = {file: folder / file for file in ("left", "right", "truth")}
        scene = SceneSource(
            "a", "b", "test", (20, 30), DisparityRange(0, 9), "semidense.datasets.readers", files, {}, True
        )
        pristine = scene.image_identity(), scene.truth_identity()
        for role, path in files.items():
            data = path.read_bytes()
            for offset in range(0, len(data), stride):
                path.write_bytes(data[:offset] + bytes([data[offset] ^ 1]) + data[offset + 1 :])
                tally.injected += 1
                image, truth = scene.image_identity() != pristine[0], scene.truth_identity() != pristine[1]
                if (image, truth) != (role != "truth", role == "truth"):
                    tally.fail("wrong", f"byte {offset} of {role}")
            path.write_bytes(data)
        moved = folder / "moved"
        files["left"].rename(moved)
        tally.injected += 1
        if (
            SceneSource(*[*vars(scene).values()][:6], {**files, "left": moved}, {}, True).image_identity()
            != pristine[0]
        ):
            tally.fail("wrong", "a file that only moved")


def _sources(tally: Tally, most: int) -> None:
    """Change tokens of the packages' modules, and add comments and blank lines."""
    chance = random.Random(9)
    for name in FOLDERS:
        for path in sorted((PROJECT / name).rglob("*.py")):
            text = path.read_text()
            pristine = source_hash(text)
            lines = text.splitlines(keepends=True)
            for expected, place, what in _chosen(list(_edits(text)), most, chance):
                edited = _spliced(lines, *place)
                tally.injected += 1
                try:
                    changed = source_hash(edited) != pristine
                except SyntaxError:
                    tally.injected -= 1
                    continue
                if changed != expected:
                    tally.fail("wrong", f"{path.name}, {what}: the hash {'changes' if changed else 'stays'}")


def _chosen(edits: list[Any], most: int, chance: random.Random) -> list[Any]:
    return edits if len(edits) <= most else chance.sample(edits, most)


def _edits(text: str) -> Iterator[tuple[bool, Place, str]]:
    """Yield edits: whether the result may change by it, what is put where, and what was done."""
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    texts = _only_text(text)
    for token in tokens:
        (row, start), (last, end) = token.start, token.end
        if token.type == tokenize.NEWLINE:
            yield False, (row, start, start, "  # a comment"), f"comment in line {row}"
        if row != last or token.type not in (tokenize.NAME, tokenize.NUMBER) or row in texts:
            continue
        if token.type == tokenize.NAME and keyword.iskeyword(token.string):
            continue
        new = f"{token.string}_" if token.type == tokenize.NAME else f"({token.string} + 1)"
        yield True, (row, start, end, new), f"{token.string} in line {row}"


def _only_text(text: str) -> set[int]:
    """Return the lines of docstrings and other statements that are only text."""
    import ast

    found: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def _spliced(lines: list[str], row: int, start: int, end: int, new: str) -> str:
    line = lines[row - 1]
    return "".join([*lines[: row - 1], line[:start] + new + line[end:], *lines[row:]])
