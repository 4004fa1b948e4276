"""Write the command that makes what is missing."""

import shlex

from semidense.cache import Store
from semidense.pipeline.api import Task
from semidense.pipeline.plan.arguments import texts
from semidense.pipeline.plan.config import setting_texts
from semidense.pipeline.plan.presets import DEFAULT


def run_command(task: Task, upto: str = "metrics") -> str:
    """Return the command that makes a product with all options of a task, ready for a shell.

    >>> run_command(Task("middlebury:my scenes", settings=["costvolume.mode=fast"]), "disparity")
    "pipeline run 'middlebury:my scenes' --set costvolume.mode=fast --upto disparity"
    """
    words = ["pipeline", "run", task.spec]
    for option, values in (("--scene", texts("scenes", task.scenes)), ("--set", setting_texts(task.settings))):
        words += [word for value in values for word in (option, value)]
    words += ["--preset", task.preset] if task.preset != DEFAULT else []
    cache = task.cache.root if isinstance(task.cache, Store) else task.cache
    for option, path in (("--config", task.config), ("--cache", cache)):
        words += [option, str(path)] if path else []
    words += ["--train"] if task.train else []
    return shlex.join([*words, *(["--upto", upto] if upto != "metrics" else [])])
