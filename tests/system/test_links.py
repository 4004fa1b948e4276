"""Every link in the documents leads to a file that is there, and to a heading that it has."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/*.md")), *sorted(ROOT.glob("stages/weights/*.md"))]
MADE = {"contributing.md", "changelog.md", "index.md"}
"""Pages that the site makes of files of the root; the site's own build checks links to the reference."""


def links(document: Path) -> list[str]:
    text = re.sub(r"^```.*?^```", "", document.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    found = re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", text))
    return [link for link in found if not link.startswith(("http:", "https:", "mailto:", "reference/"))]


def anchors(document: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda each: each.name)
def test_links_lead_somewhere(document: Path) -> None:
    for link in links(document):
        place, _, anchor = link.partition("#")
        target = document.parent / place if place else document
        assert target.exists() or place in MADE, f"{link}: no file"
        assert not anchor or anchor in anchors(target), f"{link}: no heading"


def test_there_are_links_to_check() -> None:
    assert sum(len(links(document)) for document in DOCUMENTS) > 20
