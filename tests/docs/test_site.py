"""The pages as a site: it builds without a warning, all its pages and links lead somewhere, it needs no network."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.docs.conftest import DOCS
from tests.shared import ROOT

# What a browser fetches by itself; a link (a, or link rel=canonical) waits for a click
FETCHED = {"script": "src", "img": "src", "source": "src", "video": "src", "iframe": "src", "audio": "src"}
STYLES = {"stylesheet", "icon", "shortcut icon", "preload", "prefetch", "preconnect", "dns-prefetch", "modulepreload"}


class Page(HTMLParser):
    """What one page fetches, links to, and can be linked at."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.anchors.add(values.get("id", ""))
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if values.get(FETCHED.get(tag, "")):
            self.fetched.append(values[FETCHED[tag]])
        if tag == "link" and values.get("rel", "") in STYLES:
            self.fetched.append(values["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sphinx", reason="Sphinx is not installed: make docs installs it")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", str(DOCS), str(folder)]
    built = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in site.rglob("*.html")}


def test_every_page_is_reached_from_the_first(site: Path, pages: dict[Path, Page]) -> None:
    reached, waiting = set(), [site / "index.html"]
    while waiting:
        path = waiting.pop()
        if path in reached or path not in pages:
            continue
        reached.add(path)
        local = [urlsplit(link) for link in pages[path].links]
        waiting += [(path.parent / link.path).resolve() for link in local if link.path and not link.scheme]
    written = {(site / page.relative_to(DOCS)).with_suffix(".html") for page in DOCS.rglob("*.md")}
    assert len(written) > 15
    assert written <= reached


def test_every_page_is_in_the_contents(site: Path) -> None:
    listed = re.findall(r'class="toctree-l1[^"]*"><a class="[^"]*" href="([^"#]+)"', (site / "index.html").read_text())
    written = {str(page.relative_to(DOCS).with_suffix(".html")) for page in DOCS.rglob("*.md")}
    assert set(listed) == written - {"index.html"}
    assert len(listed) == len(set(listed))


def test_every_link_and_anchor_leads_somewhere(pages: dict[Path, Page]) -> None:
    checked = 0
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), f"{path.name}: {link}"
            anchors = pages[target].anchors if target in pages else set()
            assert not parts.fragment or unquote(parts.fragment) in anchors, f"{path.name}: {link}"
            checked += 1
    assert checked > 200


def test_the_site_needs_no_network(site: Path, pages: dict[Path, Page]) -> None:
    fetched = [(path, target) for path, page in pages.items() for target in page.fetched]
    assert len(fetched) > 50
    for path, target in fetched:
        parts = urlsplit(target)
        assert parts.scheme in ("", "data"), f"{path.name} fetches {target}"
        assert not parts.netloc, f"{path.name} fetches {target}"
        assert parts.scheme or (path.parent / unquote(parts.path)).exists(), f"{path.name}: {target}"
    for style in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?(https?:)?//", style.read_text(encoding="utf-8")), style.name


def test_a_kept_page_is_shown_whole(site: Path) -> None:
    shown = (site / "elsewhere" / "fixtures.html").read_text(encoding="utf-8")
    assert "hover-fog.mp4" in shown
    assert "the site shows it here" not in shown
