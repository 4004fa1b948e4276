"""Write the archive for a benchmark's server, and read it back to check it against the published rules."""

import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from semidense.datasets import SceneSource
from semidense.pipeline.files.submissions.eth3d import ETH3D
from semidense.pipeline.files.submissions.kitti2015 import KITTI2015
from semidense.pipeline.files.submissions.middlebury import MIDDLEBURY
from semidense.pipeline.files.submissions.solved import METHOD, Form, Layout, Solved
from semidense.pipeline.files.writing import explaining, require_writable, writable_folder
from semidense.pipeline.plan.errors import UsageError, nearest

LAYOUTS = {layout.name: layout for layout in (MIDDLEBURY, KITTI2015, ETH3D)}
"""The benchmarks that can be submitted to."""


@dataclass(frozen=True)
class Written:
    """What an archive holds.

    Attributes:
        files: their number.
        seconds: what a scene took on average.
    """

    files: int
    seconds: float


def layout_of(name: str) -> Layout:
    """Return what a benchmark's server takes.

    Raises:
        UsageError: if the benchmark is not known.
    """
    if name not in LAYOUTS:
        raise UsageError(f"no server {name!r} is known; {nearest(name, LAYOUTS)}")
    return LAYOUTS[name]


def forms_of(layout: Layout, wanted: str | None) -> tuple[Form, ...]:
    """Return the forms of the maps to submit: the one that is wanted, else all that the server takes at once.

    Raises:
        UsageError: if there is no such form.
    """
    found = tuple(form for form in layout.forms if wanted in (None, form))
    if not found:
        raise UsageError(f"no form {wanted!r}; {nearest(str(wanted), layout.forms)}")
    return found if layout.several else found[:1]


def require_complete(layout: Layout, scenes: Sequence[SceneSource], partial: bool) -> str | None:
    """Say what a server lacks in these scenes; None if nothing.

    Raises:
        UsageError: if it lacks something, and the archive is not meant to be partial.
    """
    lacks = layout.lacks(scenes)
    if lacks and not partial:
        raise UsageError(f"{layout.name}: the server takes no archive {lacks}; --partial writes it all the same")
    return lacks


def require_place(method: str, path: Path) -> None:
    """Refuse a method's name or a place for the archive before the maps are made, which takes long.

    Raises:
        UsageError: if the name breaks the rules, or the place is a folder or cannot be written.
    """
    if not METHOD.fullmatch(method):
        raise UsageError(f"method {method!r}: up to 20 letters, digits, + and - stand in the names of files")
    if path.is_dir():
        raise UsageError(f"{path}: this is a folder; name the archive, such as {path / 'submission.zip'}")
    require_writable(path.parent)


def write_archive(layout: Layout, solved: Iterable[Solved], method: str, path: Path) -> Written:
    """Write the archive and check all that is in it; an existing one is replaced only by one that passes.

    Raises:
        UsageError: if the method's name or a map breaks the rules, or the archive cannot be written; none is then left.
    """
    require_place(method, path)
    writable_folder(path.parent)
    with explaining(path), TemporaryDirectory(prefix=".submission-", dir=path.parent) as folder:
        draft, seconds = Path(folder, path.name), []
        owners: dict[str, SceneSource] = {}
        with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
            for each in solved:
                seconds.append(each.seconds)
                for name, content in layout.entries(each, method):
                    _claim(owners, name, each.scene)
                    archive.writestr(name, content)
        _check(layout, draft, owners)
        draft.replace(path)
    return Written(len(owners), sum(seconds) / len(seconds))


def _claim(owners: dict[str, SceneSource], name: str, scene: SceneSource) -> None:
    if name in owners:
        raise UsageError(f"{name}: both {owners[name].name} and {scene.name} have that name; choose one with --scene")
    owners[name] = scene


def _check(layout: Layout, path: Path, owners: Mapping[str, SceneSource]) -> None:
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            layout.check(name, archive.read(name), owners[name])
