"""Write the command that makes what is missing."""

import shlex
from pathlib import Path

from semidense.datasets import Dataset
from semidense.pipeline.api import Task
from semidense.pipeline.plan.presets import DEFAULT


def run_command(task: Task, upto: str = "metrics") -> str:
    """Return the command that makes a product with all options of a task, ready for a shell.

    >>> run_command(Task("middlebury:my scenes", settings=["costvolume.mode=fast"]), "disparity")
    "pipeline run 'middlebury:my scenes' --set costvolume.mode=fast --upto disparity"
    """
    words = ["pipeline", "run", task.dataset.spec if isinstance(task.dataset, Dataset) else str(task.dataset)]
    for name, values in (("--scene", task.scenes), ("--set", task.settings)):
        words += [word for value in values for word in (name, str(value))]
    words += ["--preset", task.preset] if task.preset != DEFAULT else []
    for option, path in (("--config", task.config), ("--cache", task.cache)):
        words += [option, str(Path(path))] if path else []
    words += ["--train"] if task.train else []
    return shlex.join([*words, *(["--upto", upto] if upto != "metrics" else [])])
