"""`landtool report`: one page on a run or an evaluation."""

from __future__ import annotations

from pathlib import Path

import click

from landtool_cli import options
from landtool_cli.console import Console, pass_console

# as in landtool.report.html.film, which is loaded only when the command runs
VIDEO_MODES = ("auto", "embed", "link", "none")


@click.command("report")
@click.argument("folder", metavar="RUN|EVAL", type=options.PATH)
@options.output("The page, an .html file.", required=True)
@click.option(
    "--video",
    type=click.Choice(VIDEO_MODES),
    default="auto",
    show_default=True,
    help="The annotated video: embed it in the page, link to its file, or leave it out; auto embeds up to 25 MB.",
)
@options.overwrite
@pass_console
def command(console: Console, folder: Path, output: Path, video: str, overwrite: bool) -> None:
    """Make a page of one run of `landtool track`, or of one evaluation.

    The page is one HTML file that needs no network: the verdict first, then the video with a timeline to click on, the
    worst frames with what went wrong, charts with their numbers, and how it was made.
    """
    from landtool.report.html.write import write_report

    made = write_report(folder, output, video=video, overwrite=overwrite)  # type: ignore[arg-type]
    console.result(f"{made.output}: {made.judgement.word.lower()}, {made.bytes / 1e6:.1f} MB")
    for line in made.lines:
        console.result(f"  {line}")
