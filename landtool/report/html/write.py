"""A report into its file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from landtool.errors import UsageError
from landtool.io.atomic import atomic_path, refuse_input_as_output
from landtool.report.html.eval_page import evaluation_page
from landtool.report.html.film import VIDEO_MODES, VideoMode
from landtool.report.html.folders import Folder, read_folder
from landtool.report.html.judgement import Judgement
from landtool.report.html.page import Page, render
from landtool.report.html.run_page import run_page

SUFFIXES = (".html", ".htm")


@dataclass(frozen=True)
class ReportOutcome:
    """What was written. lines: on the video of each recording and on what is missing."""

    output: Path
    bytes: int
    judgement: Judgement
    lines: tuple[str, ...]


def write_report(folder: Path, output: Path, *, video: VideoMode = "auto", overwrite: bool = False) -> ReportOutcome:
    """Write the report of a run or an evaluation as one HTML file, whole or not at all.

    video: `embed` puts the annotated videos into the page, `link` refers to them by a relative URL, `auto` embeds up to
    25 MB of them and links the rest, `none` leaves them out. Raises UsageError for a folder that is neither, an output
    that is no .html or one of the files read, InputError for a broken record, OutputError as `atomic_path` does.
    """
    if output.suffix.lower() not in SUFFIXES:
        raise UsageError("is no name of a page", file=output, hint=f"end it with {SUFFIXES[0]}")
    if video not in VIDEO_MODES:
        raise UsageError(f"no way to show a video is called '{video}'", hint=f"known: {', '.join(VIDEO_MODES)}")
    read = read_folder(folder)
    refuse_input_as_output(_files(read.path), output)
    with atomic_path(output, overwrite=overwrite) as temporary:
        page = _page(read, output, video)
        data = render(page).encode("utf-8", "backslashreplace")
        temporary.write_bytes(data)
    return ReportOutcome(output, len(data), page.judgement, tuple(_lines(page)))


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files a report may be read from."""
    yield from (path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix not in SUFFIXES)


def _page(read: Folder, output: Path, video: VideoMode) -> Page:
    return run_page(read, output, video) if read.kind == "run" else evaluation_page(read, output, video)


def _lines(page: Page) -> Iterator[str]:
    for section in page.sections:
        if section.film is not None:
            yield f"video of {section.name}: {section.film.said[0].lower()}{section.film.said[1:].rstrip('.')}"
        yield from section.missing
    yield from page.missing
