"""Build the page: its parts in order; a part with nothing cached is left out."""

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from importlib.resources import files
from typing import Any

from semidense.pipeline.comparison.figures import dots_figure
from semidense.pipeline.execution.tasks import provenance
from semidense.pipeline.figures.curves import error_curve_figure
from semidense.pipeline.pages.html import Html, folded, table, tag, text
from semidense.pipeline.pages.reliability import reliability, reliability_figure
from semidense.pipeline.pages.report.figures_tables import (
    auc_table,
    matcher_points,
    matchers_table,
    measure_points,
    metrics_tables,
)
from semidense.pipeline.pages.report.galleries import gallery
from semidense.pipeline.pages.report.gathered import Gathered
from semidense.pipeline.pages.report.graph import graph, steps_table
from semidense.pipeline.pages.report.networks import networks
from semidense.pipeline.pages.report.pictures import svg
from semidense.pipeline.plan.config import setting_texts
from semidense.pipeline.results.metric_rows import FIGURES, MASK, THRESHOLD, averaged
from semidense.pipeline.results.settings import filter_text
from semidense.pipeline.results.text import time_text
from semidense.stages.metrics.tally import Tally

_CURVE = tuple(percent / 100 for percent in range(0, 100, 5))
"""The thresholds R of the table below the curve."""
_MARKED = (0.0, 0.5, 0.9, 0.99)
"""The thresholds R that are written beside the curve."""
_CURVE_CAPTION = "Some points of the curve, of several scenes their mean; - where a scene keeps no pixel"

_BEHIND = "How it was made"
"""The last part, which is not printed."""

GENERATOR = '<meta name="generator" content="semidense-stereo">'
"""By this a report is known."""


def page(found: Gathered) -> str:
    """Return the whole page as one HTML text that loads no other file."""
    parts = [(title, body) for title, body in _parts(found) if body]
    sections = [tag("section", tag("h2", text(title)), body, id=_anchor(title)) for title, body in parts]
    links = [tag("li", tag("a", text(title), href=f"#{_anchor(title)}")) for title, _ in parts]
    head = _head(f"{found.task.spec}: report")
    top = tag("header", *_title(found), _cards(found), tag("nav", tag("ul", *links), aria_label="Parts of this report"))
    script = f"<script>{_resource('report.js')}</script>"
    return f'<!doctype html>\n<html lang="en">{head}<body>{top}{tag("main", *sections)}{script}</body></html>\n'


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _resource(name: str) -> str:
    return (files("semidense.pipeline.pages.report") / name).read_text(encoding="utf-8")


def _head(title: str) -> Html:
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    return (
        f'<head><meta charset="utf-8">{GENERATOR}<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{text(title)}</title><style>{_resource('report.css')}</style></head>"
    )


def _title(found: Gathered) -> Iterator[Html]:
    task = found.task
    scenes = [scene.name for scene in found.scenes]
    yield tag("h1", text(f"Semi-dense stereo: {scenes[0] if len(scenes) == 1 else f'{len(scenes)} scenes'}"))
    config = [f"--config {task.config}"] * bool(task.config)
    chosen = [f"--set {each}" for each in setting_texts(task.settings)]
    told = " ".join([f"--preset {task.preset}", *config, *chosen, *["--train"] * task.train])
    yield tag("p", text(f"{task.spec}, {told}; written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"), class_="quiet")


def _cards(found: Gathered) -> Html:
    """Return the most important figures as cards for the top of the page; of several scenes their mean."""
    rows = [row for row in found.rows if row["mask"] == MASK and row["threshold_px"] == THRESHOLD]
    if not rows:
        return ""
    mean = averaged(rows)[0]
    over = f"Means of {len(rows)} of {len(found.scenes)} scenes; the others have no figures in the cache."
    over = over if len(rows) < len(found.scenes) else f"Means of {len(rows)} scenes." if len(rows) > 1 else ""
    cards = [(value, about) for name, value, about in _figures(mean, filter_text(found.filtering)) if name in mean]
    shown = [tag("div", tag("b", text(value)), tag("span", text(about)), class_="card") for value, about in cards]
    return tag("div", *shown, class_="cards") + (tag("p", text(over), class_="quiet") if over else "")


def _figures(mean: Mapping[str, Any], kept: str) -> list[tuple[str, str, str]]:
    wrong = f"off by more than {THRESHOLD:g} px"
    auc = f"AUC of the confidence ({MASK}, {THRESHOLD:g} px); a perfect order has {mean.get('auc_optimal', 0):.4f}"
    return [
        ("raw_bad", f"{mean.get('raw_bad', 0):.1f} %", f"of the {MASK} pixels {wrong} before filtering"),
        ("invalid", f"{100 - mean.get('invalid', 0):.1f} %", f"of the {MASK} pixels kept at {kept}"),
        ("bad", f"{mean.get('bad', 0):.1f} %", f"of the kept {MASK} pixels {wrong}"),
        ("auc", f"{mean.get('auc', 0):.4f}", auc),
    ]


def _parts(found: Gathered) -> Iterator[tuple[str, Html]]:
    kept = filter_text(found.filtering)
    shown = [(scene, scene.maps) for scene in found.scenes if scene.maps]
    yield "Pictures", "".join(gallery(scene.name, maps, found.filtering, scene.rows) for scene, maps in shown)
    yield "Figures", metrics_tables(found.rows, kept) + _note() if found.rows else ""
    yield "Error against invalid pixels", _curves(found)
    yield "Confidence", _confidence(found)
    yield _BEHIND, _behind(found)


def _behind(found: Gathered) -> Html:
    """Return what a reader of the results can do without, closed."""
    parts = (
        ("What ran", _what_ran(found)),
        ("Networks", networks(found)),
        ("Settings, versions and keys", _configuration(found)),
    )
    return "".join(folded(title, body) for title, body in parts if body)


def _what_ran(found: Gathered) -> Html:
    hits = len(found.hits)
    beside = sum(len(scene.baselines) for scene in found.scenes)
    told = f"{hits} of {len(found.plan.steps)} products are cached. What is missing is left out above."
    told += f" For comparison, {beside} products of other methods are cached." if beside else ""
    notes = "".join(tag("li", text(note)) for note in found.plan.notes)
    return (
        tag("p", text(told)) + graph(found) + steps_table(found) + (tag("ul", notes, class_="quiet") if notes else "")
    )


def _note() -> Html:
    told = (
        "The mask nonocc has the pixels that both views see, all also those hidden in the right view; both only where "
        "the truth is known. raw bad: wrong pixels of the map before filtering; a pixel without a disparity is wrong. "
        "invalid: pixels that the filtered map does not keep. bad: wrong pixels among those that it keeps. avgerr, "
        "rms: mean and root mean squared error of the kept pixels. Thresholds are in pixels of the image at hand. A "
        "figure that one scene lacks has no mean. Where the data set publishes no mask, hidden pixels are found by "
        "warping the truth into the right view, or by comparing the truths of both views."
    )
    return tag("p", text(told), class_="quiet")


def _tallies(found: Gathered) -> list[tuple[str, Tally]]:
    return [(scene.name, scene.maps.tally) for scene in found.scenes if scene.maps and scene.maps.tally]


def _curves(found: Gathered) -> Html:
    rows = [row for name, tally in _tallies(found) for row in tally.rows(name, threshold=THRESHOLD)]
    chosen = [row for row in rows if row["R"] in _CURVE]
    if not any("bad" in row for row in chosen):
        return ""
    drawn = error_curve_figure(
        rows,
        title="What a threshold on the confidence buys, and what it costs",
        threshold=THRESHOLD,
        others=matcher_points(found.compared, len(_tallies(found))),
        marked=_MARKED,
    )
    names = ("invalid", "bad")
    points = [[f"{row['R']:g}", *(FIGURES[name].text(row.get(name)) for name in names)] for row in averaged(chosen)]
    head = ["R", *(FIGURES[name].head for name in names)]
    figures = table(head, points, caption=_CURVE_CAPTION)
    told = svg(drawn, "Error of the kept pixels against the share of invalid ones, for each threshold R")
    return told + folded("As numbers", figures) + matchers_table(found.compared)


def _confidence(found: Gathered) -> Html:
    ranked = auc_table(found.compared)
    tallies = [tally for _, tally in _tallies(found)]
    if not tallies:
        return ranked
    drawn = reliability_figure(reliability(tallies), title="Is the confidence a probability?")
    diagram = svg(drawn, "Reliability: share of right pixels against their confidence")
    rows = measure_points(found.compared)
    if not rows:
        return tag("div", diagram, ranked, class_="charts")
    dots = dots_figure(rows, "auc", title="How well does a confidence rank pixels?", width=6.2)
    areas = svg(dots, "Area under the error curve of each measure of confidence: its mean, and a dot a scene")
    return tag("div", diagram, areas, class_="charts") + ranked


def _configuration(found: Gathered) -> Html:
    config = next(iter(found.task.request("metrics").configs.values())).to_dict()
    about = provenance([])["versions"]
    versions = table(["package", "version"], [list(pair) for pair in about.items()], caption="Versions", words=2)
    every = [[f"{part}.{name}", json.dumps(value)] for part, fields in config.items() for name, value in fields.items()]
    settings = table(["setting", "value"], every, caption="The configuration; null is found by itself", words=2)
    commands = dict.fromkeys(" ".join(entry.extras.get("command", [])) for entry in found.entries.values())
    ran = tag("p", "made by") + tag("pre", text("\n".join(command for command in commands if command)))
    return versions + folded("All settings", settings) + ran + folded("Keys of the products", _keys(found))


def _keys(found: Gathered) -> Html:
    rows = [[each.step.product, each.step.scene, each.key, _made(found, each.key)] for each in found.hits if each.key]
    rows += [
        [product, scene.name, key, _made(found, key)]
        for scene in found.scenes
        for product, key in scene.baselines.items()
    ]
    return table(["product", "scene", "key", "made (UTC)"], rows, caption="Where each product is in the cache", words=3)


def _made(found: Gathered, key: str) -> str:
    return time_text(found.entries[key].created)
