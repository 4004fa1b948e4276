from dataclasses import replace

import pytest

from semidense.cache import code_parts
from semidense.pipeline.execution.cluster.proof import require_same, runner_code
from semidense.pipeline.plan.environment import cpu_kind, environment
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.steps import Step
from tests.pipeline.toy import RAMP, step

CODE = code_parts("tests.pipeline.toy", ("tests",))
STEP = replace(step(RAMP), code=CODE, environment=environment(RAMP))


def test_the_same_code_and_environment_pass() -> None:
    require_same(STEP, runner_code())


@pytest.mark.parametrize(
    ("other", "runner", "message"),
    [
        pytest.param(
            replace(STEP, code={**CODE, "tests.pipeline.toy": "ab" * 32}),
            {},
            "the module tests.pipeline.toy has another text here",
            id="an edited stage",
        ),
        pytest.param(
            replace(STEP, code={**CODE, "semidense.stages.gone": "ab" * 32}),
            {},
            "the module semidense.stages.gone is missing here",
            id="a module too few",
        ),
        pytest.param(
            STEP,
            runner_code() | {"semidense.pipeline.execution.tiles": "ab" * 32},
            "the module semidense.pipeline.execution.tiles has another text here",
            id="another way to cut tiles",
        ),
        pytest.param(
            replace(STEP, environment={"torch": "1"}), {}, "torch is [0-9]+ here and 1 where", id="another version"
        ),
        pytest.param(
            replace(STEP, environment={"cpu": "mips"}),
            {},
            f"cpu is {cpu_kind()} here and mips where the run was started",
            id="another kind of CPU",
        ),
    ],
)
def test_what_differs_is_named_in_one_line(other: Step, runner: dict[str, str], message: str) -> None:
    with pytest.raises(UsageError, match=rf"^the worker on [^\n]+: {message}[^\n]+$"):
        require_same(other, runner)
