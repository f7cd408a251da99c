"""The `landtool` program: the table of its commands, and the one place where errors become exit codes."""

from __future__ import annotations

import importlib
import io
import os
import signal
import sys
import threading
import traceback
import warnings
from types import FrameType
from typing import Any, NoReturn

import click
from click.shell_completion import CompletionItem, shell_complete

from landtool import __version__
from landtool_cli.console import Console
from landtool_cli.explain import explain
from landtool_cli.groups import NamingGroup, help_if_alone

# Every command: its module, imported when it is called, and its line in `landtool --help`
COMMANDS = {
    "track": ("landtool_cli.commands.track", "Follow the pad through recordings: poses, track, prediction, video."),
    "report": ("landtool_cli.commands.report", "Make one page of a run or an evaluation: verdict, video, charts."),
    "eval": ("landtool_cli.commands.eval", "Score every stage against truth, and keep it from getting worse."),
    "train": ("landtool_cli.commands.train", "Train the network that finds the pad from afar."),
    "detect": ("landtool_cli.commands.detect", "Find pad and tags in recordings: boxes in pixels, video."),
    "dehaze": ("landtool_cli.commands.dehaze", "Take the haze out of recordings; kind, size and timing stay."),
    "generate": ("landtool_cli.commands.generate", "Make images and clips with exact truth, to train and to test."),
    "export": ("landtool_cli.commands.export", "Write a trained network as ONNX or as darknet's weights."),
    "pad": ("landtool_cli.commands.pad", "Make the target for printing, at true scale."),
    "calibrate": ("landtool_cli.commands.calibrate", "Measure a camera's lens from a recording of a board."),
    "info": ("landtool_cli.commands.info", "Tell what a recording, calibration or pad file holds."),
    "completion": ("landtool_cli.commands.completion", "Print the completion script of a shell."),
}

COMPLETE_VARIABLE = "_LANDTOOL_COMPLETE"


class Terminated(BaseException):
    """SIGTERM arrived. An exception, so that everything on the way out cleans up."""


class LazyGroup(NamingGroup):
    """A group whose commands are imported only when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 (click's signature)
        """Return the commands' names in the table's order."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a command; it takes the group's own options too, so that they may stand behind it."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(COMMANDS[cmd_name][0]).command
        _add_common_options(command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the table of commands without importing one."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete a command's name without importing one."""
        names = [CompletionItem(name, help=text) for name, (_, text) in COMMANDS.items() if name.startswith(incomplete)]
        return names + click.Command.shell_complete(self, ctx, incomplete)


def _add_common_options(command: click.Command) -> None:
    known = {param.name for param in command.params}
    command.params += [option for option in _common_options() if option.name not in known]
    for inner in command.commands.values() if isinstance(command, click.Group) else ():
        _add_common_options(inner)


def _common_options() -> list[click.Option]:
    """-v, -q and --debug set the console, wherever they stand."""

    def switch(ctx: click.Context, param: click.Parameter, value: bool) -> None:
        if value:
            setattr(ctx.ensure_object(Console), str(param.name), True)

    def flag(*names: str, help: str) -> click.Option:
        return click.Option(names, is_flag=True, is_eager=True, expose_value=False, callback=switch, help=help)

    return [
        flag("-v", "--verbose", help="Tell more of what is going on."),
        flag("-q", "--quiet", help="No progress, logs and warnings; results and errors only."),
        flag("--debug", help="Print the traceback of an error."),
    ]


@click.group(
    "landtool",
    cls=LazyGroup,
    params=list(_common_options()),
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, message="landtool %(version)s")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Measure, track and explain a landing on a moving platform, from recorded video. Offline."""
    help_if_alone(ctx)


def main() -> NoReturn:
    """Run the program with the arguments it was called with, and exit with its code."""
    # Matrices of 13 unknowns: threads inside numpy only fight over the cores that decode, measure and encode
    # (a third of the speed of `track`). Must stand before numpy is imported; whoever sets it keeps their choice.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Likewise threads inside OpenCV: the pictures are small, and decoder, measuring and encoder run side by side
    # (a tenth of the processor time of `track`). Read before its first use.
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")
    signal.signal(signal.SIGTERM, _terminate)
    _watch_interrupts()
    _silence_libraries()
    sys.exit(run(sys.argv[1:]))


def _watch_interrupts() -> None:
    """Turn Ctrl-C into KeyboardInterrupt whatever a library does to the signal's handler.

    AprilTag's binding puts the system's own handler in place while it searches, in which a Ctrl-C would kill the
    program with its temporary files left behind. Blocked in every thread, the signal waits for the one that takes it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    main_thread = threading.get_ident()
    signal.signal(signal.SIGUSR2, signal.default_int_handler)  # a real signal, so that it ends a wait, too

    def take() -> None:
        while True:
            signal.sigwait({signal.SIGINT})
            signal.pthread_kill(main_thread, signal.SIGUSR2)

    threading.Thread(target=take, name="interrupts", daemon=True).start()


def run(args: list[str]) -> int:
    """Run the program and return its exit code; every error becomes one line on stderr."""
    console = Console()
    try:
        code = _call(args, console)
    except BrokenPipeError:
        code = 1  # who read the results went away: nobody is left to tell
    except BaseException as error:
        code = _report(error, console)
    _close_stdout()
    return code


def _call(args: list[str], console: Console) -> int:
    """Parse and call. A command's return value is the exit code, None is 0."""
    instruction = os.environ.get(COMPLETE_VARIABLE)
    if instruction:
        return shell_complete(cli, {}, "landtool", COMPLETE_VARIABLE, instruction)
    try:
        with cli.make_context("landtool", args, obj=console) as ctx:
            value: Any = cli.invoke(ctx)
    except click.exceptions.Exit as done:  # --help and --version end so
        return done.exit_code
    return value if isinstance(value, int) else 0


def _report(error: BaseException, console: Console) -> int:
    """Print the line an error deserves and return its exit code."""
    if console.debug:
        console.traceback("".join(traceback.format_exception(error)))
    if isinstance(error, KeyboardInterrupt | click.Abort):
        console.error(f"interrupted; {console.unfinished}")
        return 130
    if isinstance(error, Terminated):
        console.error(f"terminated; {console.unfinished}")
        return 143
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else int(error.code is not None)
    text, code = explain(error, console)
    console.error(text)
    return code


def _silence_libraries() -> None:
    """Keep the libraries' own words off stderr, and names that are no UTF-8 from failing on stdout.

    `python -W` and OPENCV_LOG_LEVEL bring them back.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def _terminate(signum: int, frame: FrameType | None) -> NoReturn:  # noqa: ARG001 (a signal handler's signature)
    raise Terminated


def _close_stdout() -> None:
    """Drop what stdout could not take, or the interpreter would fail on it once more at its end."""
    if sys.stdout is None:  # started with stdout closed
        return
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
