"""What a worker proves before it works: that it runs the code and the packages that the plan's keys name.

A plan names the code of the process that made it. A worker may have another: an edited file, another installation.
"""

import socket
from collections.abc import Mapping

from semidense.cache import module_hash
from semidense.pipeline.plan.environment import environment
from semidense.pipeline.plan.errors import UsageError
from semidense.pipeline.plan.steps import Step, code_of


def runner_code() -> dict[str, str]:
    """Return the hash of each module that carries out tasks: they decide how tiles are cut and results are stored."""
    return code_of("semidense.pipeline.execution.tasks")


def require_same(step: Step, runner: Mapping[str, str]) -> None:
    """Refuse to work on a step whose code or environment is another here than where it was planned.

    Args:
        step: to work on.
        runner: ``runner_code`` of the process that planned it.

    Raises:
        UsageError: naming this machine and the first module or version that differs.
    """
    require_same_code({**step.code, **runner})
    own = environment(step.stage)
    for name, version in step.environment.items():
        if own.get(name) != version:
            raise UsageError(_refusal(f"{name} is {own.get(name)} here and {version} where the run was started"))


def require_same_code(code: Mapping[str, str]) -> None:
    """Refuse to work where one of these modules has another text than its hash says.

    Raises:
        UsageError: naming this machine and the module.
    """
    for module, expected in code.items():
        if (found := module_hash(module)) != expected:
            what = "has another text here than" if found else "is missing here, unlike"
            raise UsageError(_refusal(f"the module {module} {what} where the run was started"))


def _refusal(difference: str) -> str:
    return (
        f"the worker on {socket.gethostname()} would make another result: {difference}; "
        "give all workers the same installation and restart them"
    )
