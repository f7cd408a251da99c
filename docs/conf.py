"""How Sphinx builds these pages as a site: `make docs`. They are plain Markdown, and read as well without it."""

from __future__ import annotations

import os
import re
from pathlib import Path

from sphinx.application import Sphinx

import landtool

DOCS = Path(__file__).resolve().parent
# Pages of the site that are kept elsewhere in the repository; Sphinx wants a file below docs/ for each, which leads on
ELSEWHERE = {
    "elsewhere/fixtures": DOCS.parent / "datasets" / "README.md",
    "elsewhere/model-card": DOCS.parent / "landtool" / "models" / "README.md",
    "elsewhere/contributing": DOCS.parent / "CONTRIBUTING.md",
    "elsewhere/changes": DOCS.parent / "CHANGELOG.md",
}
LINK = re.compile(r"\]\(([^)\s#:]+)(#[^)\s]*)?\)")

project = "landtool"
version = release = landtool.__version__
copyright = "the authors of landtool, Apache-2.0"
extensions = ["myst_parser"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = f"landtool {version}"
html_show_sphinx = False
html_copy_source = False


def setup(app: Sphinx) -> None:
    """Let Sphinx see what a forge does not need."""
    app.connect("source-read", read_page)


def read_page(_app: Sphinx, name: str, source: list[str]) -> None:
    """Take a page's text from where it is kept, turn its links to the site's, and give the first page its contents."""
    kept = ELSEWHERE.get(name, DOCS / f"{name}.md")
    shown = (DOCS / name).parent
    text = kept.read_text(encoding="utf-8")
    text = LINK.sub(lambda found: f"]({_on_site(kept, found[1], shown)}{found[2] or ''})", text)
    source[0] = text + contents(text) if name == "index" else text


def contents(index: str) -> str:
    """Return the site's table of contents: the pages that the tables of the first page link, by their headings."""
    made = ""
    for part in re.split(r"^## ", index, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        pages = dict.fromkeys(re.findall(r"^\| \[[^\]]+\]\(([\w/-]+)\.md\)", body, re.MULTILINE))
        lines = "\n".join(pages)
        made += f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{lines}\n```\n" if pages else ""
    return made


def _on_site(page: Path, target: str, shown: Path) -> str:
    """Return the target of a link in `page` as seen from the folder `shown`."""
    path = (page.parent / target).resolve()
    names = {kept: DOCS / f"{name}.md" for name, kept in ELSEWHERE.items()}
    return os.path.relpath(names.get(path, path), shown)
