"""Install the four folders inside one namespace: ``pipeline/`` is imported as ``semidense.pipeline``, and so on."""

from setuptools import find_packages, setup

FOLDERS = ("pipeline", "stages", "datasets", "cache")

setup(
    packages=[
        f"semidense.{name}"
        for name in find_packages(include=[part for name in FOLDERS for part in (name, f"{name}.*")])
    ],
    package_dir={f"semidense.{name}": name for name in FOLDERS},
)
