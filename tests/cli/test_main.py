"""The program's frame: lazy commands, one line an error, the exit codes, signals, and who prints where."""

from __future__ import annotations

import errno
import importlib
import io
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import types
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from landtool import __version__
from landtool.errors import InputError, OutputError, OutputExistsError, UsageError
from landtool_cli.console import Console, pass_console
from landtool_cli.main import COMMANDS, run

Said = pytest.CaptureFixture[str]
Act = Callable[[Console], object]


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Callable[[Act], None]:
    """Return a function that makes `landtool fake` do what is asked."""

    def install(act: Act) -> None:
        @click.command("fake")
        @click.option("--number", type=click.IntRange(1, 9))
        @pass_console
        def command(console: Console, number: int | None) -> object:  # noqa: ARG001 (there to be parsed)
            return act(console)

        module = types.ModuleType("fake_command")
        module.__dict__["command"] = command
        monkeypatch.setitem(sys.modules, "fake_command", module)
        monkeypatch.setitem(COMMANDS, "fake", ("fake_command", "Do what the test wants."))

    return install


def raising(error: BaseException) -> Act:
    def act(console: Console) -> object:  # noqa: ARG001
        raise error

    return act


def program(script: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a process of its own."""
    return subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False)


# --- what is there -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(COMMANDS))
def test_every_command_of_the_table_exists(name: str) -> None:
    command = importlib.import_module(COMMANDS[name][0]).command
    assert isinstance(command, click.Command)
    assert command.name == name


def test_help_lists_the_commands_and_loads_nothing_slow() -> None:
    done = program(
        """
            import sys, time
            start = time.perf_counter()
            from landtool_cli.main import run
            code = run(["--help"])
            print(f"{time.perf_counter() - start:.3f} s", file=sys.stderr)
            print("LOADED", sorted({name.split(".")[0] for name in sys.modules}))
            sys.exit(code)
            """
    )
    assert done.returncode == 0
    print("landtool --help took", done.stderr)  # a time to look at: no clock fails a test
    for name, (_, text) in COMMANDS.items():
        assert name in done.stdout
        assert text.split()[0] in done.stdout
    loaded = done.stdout.split("LOADED")[1]
    for slow in ("numpy", "cv2", "av", "matplotlib", "reportlab", "tqdm", "yaml", "onnxruntime"):
        assert f"'{slow}'" not in loaded


def test_without_arguments_it_helps(capsys: Said) -> None:
    assert run([]) == 0
    assert "Usage: landtool" in capsys.readouterr().out


def test_version(capsys: Said) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"landtool {__version__}\n"


@pytest.mark.parametrize("args", [["-h"], ["--help"], ["completion", "-h"], ["completion", "--help"]])
def test_help_everywhere(args: list[str], capsys: Said) -> None:
    assert run(args) == 0
    out = capsys.readouterr().out
    for option in ("-v, --verbose", "-q, --quiet", "--debug", "-h, --help"):
        assert out.count(option) == 1


# --- exit codes and the one line -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("value", "code"), [(None, 0), (0, 0), (1, 1), (3, 3)])
def test_a_command_s_value_is_the_exit_code(value: object, code: int, fake: Callable[[Act], None]) -> None:
    fake(lambda _: value)
    assert run(["fake"]) == code


def os_error(number: int, file: str | None = None) -> OSError:
    return OSError(number, os.strerror(number), file) if file else OSError(number, os.strerror(number))


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("no frames", file="a.mp4", hint="record again"), 1, "a.mp4: no frames; record again"),
        (UsageError("is a URL", file="http://x", hint="give a file"), 2, "http://x: is a URL; give a file"),
        (OutputExistsError("o.csv"), 2, "o.csv: exists already; choose another -o or pass --overwrite"),
        (OutputError("cannot be written", file="o"), 1, "o: cannot be written"),
        (InputError("line one\nline two", file="a"), 1, "a: line one line two"),
        (os_error(errno.ENOSPC, "/d/x"), 1, "/d/x: No space left on device; free some space"),
        (os_error(errno.ENOSPC), 1, "in.mp4: No space left on device; free some space"),
        (os_error(errno.EACCES, "/d/x"), 1, "/d/x: Permission denied; check the permissions"),
        (os_error(errno.EROFS, "/d/x"), 1, "/d/x: Read-only file system; choose a place"),
        (MemoryError(), 1, "in.mp4: out of memory; "),
        (EOFError("odd"), 1, "in.mp4: internal error: EOFError: odd; run again with --debug"),
        (ZeroDivisionError(), 1, "in.mp4: internal error: ZeroDivisionError; run again with --debug"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (click.Abort(), 130, "interrupted"),
        (click.BadParameter("no good", param_hint="--x"), 2, "invalid value for --x: no good; see 'landtool"),
        (click.FileError("f.txt", "gone"), 1, "could not open file 'f.txt': gone"),
    ],
)
def test_an_error_is_one_line(
    error: BaseException, code: int, line: str, fake: Callable[[Act], None], capsys: Said
) -> None:
    def act(console: Console) -> None:
        console.file = Path("in.mp4")
        raise error

    fake(act)
    assert run(["fake"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"landtool: error: {line}")
    assert err.count("\n") == 1


@pytest.mark.parametrize("args", [["--debug", "fake"], ["fake", "--debug"]])
def test_debug_shows_the_traceback_above_the_line(args: list[str], fake: Callable[[Act], None], capsys: Said) -> None:
    fake(raising(ValueError("bug")))
    assert run(args) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("Traceback")
    assert any("test_main.py" in line for line in lines)
    assert lines[-1].startswith("landtool: error: internal error: ValueError: bug; ")


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["fak"], "no such command 'fak'; did you mean 'fake'?"),
        (["xyzzy"], "no such command 'xyzzy'; did you mean '"),
        (["fake", "--nmber", "1"], "no such option '--nmber'; did you mean --number?"),
        (["fake", "--debgu"], "no such option '--debgu'; did you mean --debug?"),
        (["--vesion"], "no such option '--vesion'; did you mean --version?"),
        (["fake", "--number"], "option '--number' requires an argument; see 'landtool --help'"),
        (["fake", "--number", "10"], "invalid value for '--number': 10 is not in the range 1<=x<=9; see 'landtool"),
        (["fake", "what"], "got unexpected extra argument ('what'); see 'landtool fake --help'"),
        (["completion"], "missing argument 'SHELL'"),
    ],
)
def test_a_wrong_call_is_one_line_naming_the_nearest(
    args: list[str], line: str, fake: Callable[[Act], None], capsys: Said
) -> None:
    fake(lambda _: 0)
    assert run(args) == 2
    err = capsys.readouterr().err
    assert err.replace("(what)", "('what')").startswith(f"landtool: error: {line}")
    assert err.count("\n") == 1


# --- signals and streams -------------------------------------------------------------------------------------------

SLOW = """
    import ctypes, sys, time, types
    from pathlib import Path
    import click
    from landtool.io.atomic import atomic_path
    from landtool_cli import main

    @click.command("slow")
    def command():
        with atomic_path(Path(sys.argv[1]) / "out.csv") as path:
            path.write_text("half")
            ctypes.CDLL(None).signal(2, None)  # the system's own handler, as a library may put it in place
            print("ready", flush=True)
            time.sleep(60)

    sys.modules["slow"] = types.SimpleNamespace(command=command)
    main.COMMANDS["slow"] = ("slow", "")
    folder, sys.argv[1:] = sys.argv[1], [sys.argv[1]]
    run, main.run = main.run, lambda args: run(["slow"])
    main.main()
    """


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_leaves_nothing_half_done(number: signal.Signals, code: int, tmp_path: Path) -> None:
    start = [sys.executable, "-c", textwrap.dedent(SLOW), str(tmp_path)]
    with subprocess.Popen(start, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)
        _, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert err.startswith("landtool: error: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_goes_away_is_no_error_to_tell() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        start = [sys.executable, "-c", "from landtool_cli.main import main; main()", "completion", "bash"]
        done = subprocess.run(start, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    finally:
        os.close(writing)
    assert done.returncode == 1
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_results_that_do_not_fit_are_said() -> None:
    with Path("/dev/full").open("w") as full:
        start = [sys.executable, "-c", "from landtool_cli.main import main; main()", "completion", "bash"]
        done = subprocess.run(start, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("landtool: error: standard output: No space left on device; ")
    assert done.stderr.count("\n") == 1


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def on_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Make stderr a terminal; called in the test's body, as pytest sets stderr again between a fixture and the test."""
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return stream


def say_all(console: Console) -> None:
    console.log("a log")
    console.detail("a detail")
    console.warning("a warning")
    with console.counter(label="counting") as counter:
        counter.expect(2)
        counter.add()
    console.result("a result")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], ["landtool: warning: a warning"]),
        (["-v"], ["a log", "a detail", "landtool: warning: a warning"]),
        (["--quiet"], []),
    ],
)
@pytest.mark.parametrize("behind", [False, True])
def test_without_a_terminal_stderr_is_for_warnings(
    options: list[str], said: list[str], behind: bool, fake: Callable[[Act], None], capsys: Said
) -> None:
    fake(say_all)
    assert run(["fake", *options] if behind else [*options, "fake"]) == 0
    out, err = capsys.readouterr()
    assert out == "a result\n"
    assert err.splitlines() == said


def test_a_terminal_gets_logs_and_progress(monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    terminal = on_terminal(monkeypatch)
    say_all(Console())
    text = terminal.getvalue()
    assert "a log" in text
    assert "a detail" not in text
    assert "counting" in text
    assert "0/2" in text
    assert capsys.readouterr().out == "a result\n"


def test_a_quiet_terminal_gets_none(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    say_all(Console(quiet=True))
    assert terminal.getvalue() == ""


def test_colour_is_for_terminals_that_want_it(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    Console().error("bad")
    assert terminal.getvalue() == "landtool: \x1b[31merror:\x1b[0m bad\n"
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        terminal = on_terminal(monkeypatch)
        monkeypatch.setenv(name, value)
        Console().error("bad")
        assert terminal.getvalue() == "landtool: error: bad\n"


def test_a_line_told_meanwhile_does_not_tear_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = on_terminal(monkeypatch)
    console = Console()
    with console.counter(label="counting") as counter:
        counter.expect(2)
        for _ in range(2):
            counter.add()
            console.log("between")
    lines = terminal.getvalue().replace("\r", "\n").splitlines()
    assert lines.count("between") == 2
    assert any("counting" in line for line in lines)


# --- completion ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_scripts(shell: str, capsys: Said) -> None:
    assert run(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "_LANDTOOL_COMPLETE" in script
    binary = shutil.which(shell)
    if binary:
        checked = subprocess.run([binary, "-n"], input=script, capture_output=True, text=True, check=False)
        assert checked.returncode == 0, checked.stderr


@pytest.mark.parametrize(
    ("words", "at", "wanted"),
    [
        ("landtool com", 1, "plain,completion"),
        ("landtool completion z", 2, "plain,zsh"),
        ("landtool --ver", 1, "plain,--ver"),
    ],
)
def test_the_shell_is_answered(words: str, at: int, wanted: str, monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    monkeypatch.setenv("_LANDTOOL_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(at))
    assert run([]) == 0
    assert wanted in capsys.readouterr().out
