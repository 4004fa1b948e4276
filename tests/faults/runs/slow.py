"""Toy stages that take a while, so that a kill finds them at work; their code is hashed, as a cluster asks for."""

import time
from dataclasses import replace

from semidense.cache import code_parts
from semidense.pipeline.plan.steps import Graph, Step
from semidense.stages.stage import Arrays, Inputs
from tests.pipeline import toy

SECONDS = 0.6
"""A run of eight scenes then takes several times as long as a worker that was killed takes to be there again."""


def make_ramp(start: int, inputs: Inputs) -> Arrays:
    time.sleep(SECONDS)
    return toy.make_ramp(start, inputs)


def make_blurred(params: toy.Offset, inputs: Inputs) -> Arrays:
    time.sleep(SECONDS)
    return toy.make_blurred(params, inputs)


def make_sum(argument: object, inputs: Inputs) -> Arrays:
    time.sleep(SECONDS)
    return toy.make_sum(argument, inputs)


RAMP = replace(toy.RAMP, compute=f"{__name__}:make_ramp")
BLURRED = replace(toy.BLURRED, compute=f"{__name__}:make_blurred")
SUM = replace(toy.SUM, compute=f"{__name__}:make_sum")


def scenes(count: int) -> Graph:
    """A ramp, blurred in tiles, and its sum, for each of some scenes."""
    code = code_parts(__name__, ("tests",))
    steps: list[Step] = []
    for number in range(count):
        name = f"Scene{number}"
        ramp = toy.step(RAMP, number, scene=name)
        blurred = toy.step(BLURRED, toy.Offset(reach=1), scene=name, ramp=ramp)
        steps += [ramp, blurred, toy.step(SUM, scene=name, blurred=blurred)]
    return Graph({each.id: replace(each, code=code) for each in steps}, [(steps[-1].id, "")])
