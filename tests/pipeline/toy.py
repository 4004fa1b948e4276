"""Small stages whose results can be checked by hand, and graphs of them: the runner's tests need no networks."""

import os
import signal
import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np

from semidense.pipeline.plan.plan import Plan, Planned
from semidense.pipeline.plan.steps import Graph, Step
from semidense.stages.stage import Arrays, Inputs, Output, Params, Stage, StageError

HEIGHT, WIDTH = 10, 4
CALLS: list[str] = []
"""Which functions ran, in the order in which they did."""
_LOCK = threading.Lock()


class Offset(Params):
    """What is added."""

    offset: int = 0
    reach: int = 0


def seen(name: str) -> None:
    with _LOCK:
        CALLS.append(name)


def make_ramp(start: int, _: Inputs) -> Arrays:
    seen("ramp")
    return {"values": np.arange(start, start + HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)}


def make_clipped(_: Any, inputs: Inputs) -> Arrays:  # noqa: ANN401
    """Content that does not change when the ramp starts elsewhere."""
    seen("clipped")
    return {"values": np.minimum(inputs["ramp"]["values"], 0)}


def make_blurred(params: Offset, inputs: Inputs) -> Arrays:
    """The sum over the column's neighbours within reach: needs a halo, and says whether it had the right one."""
    seen("blurred")
    values, reach = inputs["ramp"]["values"], params.reach
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    total = sum(padded[shift : shift + len(values)] for shift in range(2 * reach + 1))
    return {"values": np.asarray(total + params.offset, np.float32), "level": np.array([params.offset], np.int32)}


def make_shrunk(params: Offset, inputs: Inputs) -> Arrays:
    """The same for a block that brings its border on all four sides."""
    values, side = inputs["ramp"]["values"], 2 * params.reach + 1
    windows = np.lib.stride_tricks.sliding_window_view(values, (side, side))
    return {"values": windows.sum(axis=(2, 3)).astype(np.float32), "level": np.array([side], np.int32)}


def make_sum(_: Any, inputs: Inputs) -> Arrays:  # noqa: ANN401
    seen("sum")
    return {"sum": np.array([inputs["blurred"]["values"].sum()], np.float64)}


def fail_below(_: Any, inputs: Inputs) -> Arrays:  # noqa: ANN401
    if inputs["ramp"]["values"].min() >= 16:
        raise RuntimeError("the fourth row broke it")
    return {"values": inputs["ramp"]["values"], "level": np.zeros(1, np.int32)}


def refuse(_: Any, inputs: Inputs) -> Arrays:  # noqa: ANN401
    raise StageError("these values are no good")


def note_and_ramp(folder: str, inputs: Inputs) -> Arrays:
    """Leave a file for each call, in whichever process it is."""
    os.close(tempfile.mkstemp(dir=folder)[0])
    return make_ramp(0, inputs)


def die_once(marker: str, inputs: Inputs) -> Arrays:
    """Kill the process, unless a call before did so."""
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return make_sum(marker, inputs)


def train_toy(_: Any, inputs: Inputs, monitor: Any) -> Arrays:  # noqa: ANN401
    for done in range(1, 4):
        monitor.progress(done, 3, "loss 0.5")
        monitor.save(bytes([done]))
    return {"sum": np.array([1.0])}


_VALUES = Output("values", ("y", "x"), "float32", "px", "numbers")
_LEVEL = Output("level", ("one",), "int32", "1", "the offset")
_SUM = (Output("sum", ("one",), "float64", "1", "the sum"),)
RAMP = Stage("ramp", (), (_VALUES,), "tests.pipeline.toy:make_ramp")
BLURRED = Stage(
    "blurred",
    ("ramp",),
    (_VALUES, _LEVEL),
    "tests.pipeline.toy:make_blurred",
    Offset,
    tile_rows=4,
    halo=lambda params: params.reach,
    sizes=lambda _: {"one": 1},
)
SUM = Stage("sum", ("blurred",), _SUM, "tests.pipeline.toy:make_sum")


def step(stage: Stage, argument: object = None, code: str = "1f", scene: str = "Toy", **inputs: Step) -> Step:
    """A step of a toy stage; its settings are its argument."""
    settings = argument.model_dump() if isinstance(argument, Params) else {"argument": argument}
    name = f"{stage.product}:{scene}:{settings}"
    ids = {product: (each.id,) for product, each in inputs.items()}
    label, code_hashes = "toys", {stage.compute.partition(":")[2]: code}
    return Step(name, stage, scene, label, argument, settings, ids, (HEIGHT, WIDTH), code_hashes, {})


def chain(start: int = 0, offset: int = 0, reach: int = 0, code: str = "1f", stage: Stage = BLURRED) -> Graph:
    """A ramp, blurred in tiles, and the sum of that."""
    ramp = step(RAMP, start)
    blurred = step(stage, Offset(offset=offset, reach=reach), code, ramp=ramp)
    return graph(ramp, blurred, step(SUM, blurred=blurred))


def graph(*steps: Step) -> Graph:
    return Graph({each.id: each for each in steps}, [(steps[-1].id, "")])


def states(plan: Plan) -> dict[str, str]:
    return {planned.step.product: planned.state for planned in plan.steps}


def changes(planned: Planned) -> list[str]:
    return [str(change) for change in planned.changed]
