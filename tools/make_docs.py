"""Write the parts of docs/ that come from the code, between `<!-- begin NAME -->` and `<!-- end NAME -->`.

Run: `python tools/make_docs.py` after a change of commands, options, settings, modules or the pad. With `--pictures` it
also draws docs/pictures again, with `--check` it writes nothing and names the pages that are stale.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
import tomllib
import typing
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Literal

import click

from landtool import config
from landtool.config import DehazeCommandConfig, DetectConfig, EvalConfig, GenerateConfig, TrackConfig
from landtool.dehaze import config as dehaze
from landtool.detect import config as detector
from landtool.families import tag_family
from landtool.io.mcap_decoders import VIDEO_CODECS
from landtool.io.mcap_messages import CALIBRATION_PARSERS, IMAGE_PARSERS
from landtool.io.mcap_pixels import LAYOUTS
from landtool.io.mcap_poses import POSE_PARSERS
from landtool.pad import PadSpec
from landtool.tracking import tracker
from landtool.train import settings as training
from landtool.train.settings import TrainSettings
from landtool_cli.main import COMMANDS, cli

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
_COMMON = ("help", "verbose", "quiet", "debug")
_BOUNDS = config.BOUNDS | tracker.BOUNDS | detector.BOUNDS | training.BOUNDS | dehaze.BOUNDS | dehaze.PAPER_BOUNDS
# What the lists of texts in settings are made of
_LISTS: dict[tuple[type, str], tuple[str, ...]] = {
    (TrackConfig, "save"): config.TRACK_SAVES,
    (DetectConfig, "save"): config.SAVES,
    (EvalConfig, "save"): config.EVAL_SAVES,
    (EvalConfig, "stages"): config.EVAL_STAGES,
}
_KINDS = {"int": "whole number", "float": "number", "str": "text", "bool": "true or false", "Path": "file name"}


def main(arguments: list[str]) -> int:
    """Write or check the pages; return 1 when a check finds a stale one."""
    if "--pictures" in arguments:
        sys.path.insert(0, str(Path(__file__).parent))
        importlib.import_module("make_docs_pictures").main()
    stale = {path: text for path, text in pages().items() if path.read_text(encoding="utf-8") != text}
    for path, text in stale.items():
        if "--check" not in arguments:
            path.write_text(text, encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {'stale' if '--check' in arguments else 'written'}")
    return int(bool(stale) and "--check" in arguments)


def pages() -> dict[Path, str]:
    """Return every page that has generated parts, with the text it should have."""
    made = {}
    for path in sorted(DOCS.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        names = re.findall(r"^<!-- begin (.+) -->$", text, re.MULTILINE)
        for name in names:
            begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
            head, rest = text.split(begin)
            text = f"{head}{begin}\n{PARTS[name]()}\n\n{end}{rest.split(end)[1]}"
        if names:
            made[path] = text
    return made


# --- commands ------------------------------------------------------------------------------------------------------


def command_reference() -> str:
    """Describe every command with its arguments and options."""
    parent = click.Context(cli, info_name="landtool")
    return "\n\n".join(_command(name, cli.get_command(parent, name)) for name in COMMANDS)


def _command(name: str, command: click.Command | None) -> str:
    assert command is not None
    if isinstance(command, click.Group):
        inner = [_command(f"{name} {key}", item) for key, item in command.commands.items()]
        usage = f"`landtool {name} COMMAND`"
        return "\n\n".join([f"## landtool {name}", usage, inspect.cleandoc(command.help or ""), *inner])
    options = [p for p in command.params if isinstance(p, click.Option) and p.name not in _COMMON]
    arguments = [p.make_metavar(click.Context(command)) for p in command.params if isinstance(p, click.Argument)]
    usage = " ".join(["landtool", name, *arguments, *(["[OPTIONS]"] if options else [])])
    blocks = [f"## landtool {name}", f"`{usage}`", inspect.cleandoc(command.help or "")]
    if options:
        blocks.append(_table(("option", "meaning"), ((f"`{_names(o)}`", _meaning(o)) for o in options)))
    if command.epilog:
        title, *lines = command.epilog.replace("\b\n", "").splitlines()
        blocks.append(f"{title}\n\n```text\n" + "\n".join(line.strip() for line in lines) + "\n```")
    return "\n\n".join(blocks)


def _names(option: click.Option) -> str:
    names = ", ".join(option.opts) + "".join(f", {name}" for name in option.secondary_opts)
    return names if option.is_flag else f"{names} {_metavar(option)}"


def _metavar(option: click.Option) -> str:
    if option.metavar:
        return option.metavar
    if isinstance(option.type, click.Choice):
        return "|".join(map(str, option.type.choices))
    return "PATH" if isinstance(option.type, click.Path) else "N"


def _meaning(option: click.Option) -> str:
    text = re.sub(r"\s*\[default: (.*?)\]", r" Default: \1.", option.help or "")
    if option.show_default and option.default is not None:
        text += f" Default: {option.default}."
    low, high = (getattr(option.type, side, None) for side in ("min", "max"))
    if low is not None and high is not None:
        text += f" From {low:g} to {high:g}."
    return f"{text} Required." if option.required else text


def common_options() -> str:
    """Describe the options every command has."""
    command = cli.get_command(click.Context(cli), "completion")
    assert command is not None
    options = {p.name: p for p in command.params if isinstance(p, click.Option)}
    rows = [(f"`{_names(options[n])}`", _meaning(options[n])) for n in _COMMON if n in options]
    rows += [
        ("`-h, --help`", "Show the help of landtool or of a command."),
        ("`--version`", "Print the version; only `landtool --version`."),
    ]
    return _table(("option", "meaning"), rows)


# --- settings ------------------------------------------------------------------------------------------------------


def settings_reference() -> str:
    """Describe every key of a settings file: type, default, option, and the comment above the field."""
    command = cli.get_command(click.Context(cli), "track")
    assert command is not None
    options = {(p.name or "").replace("__", "."): p.opts[0] for p in command.params if isinstance(p, click.Option)}
    options["hfov_deg"] = options.pop("hfov")
    parts = [_settings_table(TrackConfig(), "", options)]
    for name in ("tags", "tracker"):
        parts += [f"In the table `[{name}]`:", _settings_table(getattr(TrackConfig(), name), f"{name}.", options)]
    return "\n\n".join(parts)


def detect_settings() -> str:
    """Describe the keys of a settings file for `landtool detect`."""
    command = cli.get_command(click.Context(cli), "detect")
    assert command is not None
    options = {(p.name or "").replace("__", "."): p.opts[0] for p in command.params if isinstance(p, click.Option)}
    parts = [_settings_table(DetectConfig(), "", options)]
    for name in ("detector", "tags"):
        parts += [f"In the table `[{name}]`:", _settings_table(getattr(DetectConfig(), name), f"{name}.", options)]
    return "\n\n".join(parts)


def dehaze_settings() -> str:
    """Describe the keys of a settings file for `landtool dehaze`."""
    command = cli.get_command(click.Context(cli), "dehaze")
    assert command is not None
    options = {(p.name or "").replace("__", "."): p.opts[0] for p in command.params if isinstance(p, click.Option)}
    base = DehazeCommandConfig()
    tables = {"dehazer": base.dehazer, "dehazer.paper": base.dehazer.paper}
    parts = [_settings_table(base, "", options)]
    for name, table in tables.items():
        parts += [f"In the table `[{name}]`:", _settings_table(table, f"{name}.", options)]
    return "\n\n".join(parts)


def eval_settings() -> str:
    """Describe the keys of the table [eval], which `landtool eval` reads besides those of `landtool track`."""
    command = cli.get_command(click.Context(cli), "eval")
    assert command is not None
    options = {p.name or "": p.opts[0] for p in command.params if isinstance(p, click.Option)}
    return _settings_table(EvalConfig(), "", options)


def generate_settings() -> str:
    """Describe the keys of a settings file for `landtool generate images`, without those of its domain."""
    group = cli.get_command(click.Context(cli), "generate")
    assert isinstance(group, click.Group)
    options = {p.name or "": p.opts[0] for p in group.commands["images"].params if isinstance(p, click.Option)}
    return _settings_table(GenerateConfig(), "", options)


def train_settings() -> str:
    """Describe the keys of a settings file for `landtool train`."""
    command = cli.get_command(click.Context(cli), "train")
    assert command is not None
    options = {p.name or "": p.opts[0] for p in command.params if isinstance(p, click.Option)}
    return _settings_table(TrainSettings(), "", options)


def domain_settings() -> str:
    """Describe what generated pictures vary in."""
    return _settings_table(GenerateConfig().domain, "", {})


def _settings_table(defaults: Any, where: str, options: dict[str, str]) -> str:
    kind = type(defaults)
    hints, said = typing.get_type_hints(kind), field_comments(kind)
    rows = []
    for field in fields(kind):
        value = getattr(defaults, field.name)
        if is_dataclass(value):
            continue
        option = options.get(where + field.name)
        rows.append((
            f"`{field.name}`",
            _type_text(field.name, hints[field.name], _LISTS.get((kind, field.name), ())),
            _toml(value),
            f"`{option}`" if option else "",
            said[field.name],
        ))  # fmt: skip
    return _table(("key", "type", "default", "option", "meaning"), rows)


def field_comments(kind: type) -> dict[str, str]:
    """Return the comment above each field of a dataclass; fields right below one another share theirs."""
    said: dict[str, str] = {}
    comment: list[str] = []
    fresh = True
    for line in inspect.getsource(kind).splitlines():
        if found := re.match(r"    # (.+)", line):
            comment = [found[1]] if fresh else [*comment, found[1]]
            fresh = False
        elif found := re.match(r"    (\w+): ", line):
            said[found[1]] = " ".join(comment)
            fresh = True
    return said


def _type_text(name: str, hint: Any, choices: tuple[str, ...]) -> str:
    kind = next((k for k in typing.get_args(hint) if k is not type(None)), hint) if _is_optional(hint) else hint
    if typing.get_origin(kind) is Literal:
        return " or ".join(f'`"{v}"`' for v in typing.get_args(kind))
    if typing.get_origin(kind) is tuple and typing.get_args(kind)[0] is not str:
        return (
            "two numbers" if len(typing.get_args(kind)) == 2 and ... not in typing.get_args(kind) else "list of numbers"
        )
    if typing.get_origin(kind) is tuple:
        return "list of " + (", ".join(f'`"{v}"`' for v in choices) or "texts")
    low, high = _BOUNDS.get(name, (None, None))
    return _KINDS[kind.__name__] + ("" if low is None else f", {low:g} to {high:g}")


def _is_optional(hint: Any) -> bool:
    return type(None) in typing.get_args(hint)


def _toml(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        value = list(value)
    return f"`{value!r}`".replace("'", '"')


# --- modules, layers, pad --------------------------------------------------------------------------------------------


def module_tree() -> str:
    """List every module of the library and of the command line with the first line of its docstring."""
    lines = []
    for top, title in ((ROOT / "landtool", "landtool/"), (ROOT / "cli" / "landtool_cli", "cli/landtool_cli/")):
        lines += [("", title, _summary(top / "__init__.py")), *_modules(top, "  ")]
    width = max(len(indent + name) for indent, name, _ in lines) + 2
    text = "\n".join(f"{indent + name:<{width}}{said}".rstrip() for indent, name, said in lines)
    return f"```text\n{text}\n```"


def _modules(folder: Path, indent: str) -> Iterator[tuple[str, str, str]]:
    entries = [p for p in sorted(folder.iterdir()) if p.suffix == ".py" or (p / "__init__.py").exists()]
    for path in sorted(entries, key=lambda p: (p.is_dir(), p.name)):
        if path.is_dir():
            yield indent, f"{path.name}/", _summary(path / "__init__.py")
            yield from _modules(path, indent + "  ")
        elif path.name != "__init__.py":
            yield indent, path.name, _summary(path)


def _summary(path: Path) -> str:
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0].replace("\n", " ")


def import_order() -> str:
    """Show the layers of pyproject.toml that exist, the highest first."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = next(c for c in project["tool"]["importlinter"]["contracts"] if c["id"] == "layers")
    rows = ["landtool_cli"]
    for layer in contract["layers"]:
        names = [name.strip() for name in layer.split(":")]
        rows.append(", ".join(name for name in names if not name.startswith("(") or _exists(name.strip("()"))))
    return "```text\n" + "\n".join(filter(None, rows)) + "\n```"


def _exists(name: str) -> bool:
    return (ROOT / "landtool" / name).exists() or (ROOT / "landtool" / f"{name}.py").exists()


def pad_table() -> str:
    """Give the sizes of pad v1, as parts of D and in mm."""
    pad = PadSpec()
    assert pad.board is not None
    assert pad.ring is not None
    assert pad.letter is not None
    assert pad.quiet_zone is not None
    tag = pad.tags[0]
    sizes = [
        ("board", "square, side", pad.board.side, pad.board.color),
        ("ring", "outer diameter", pad.ring.outer, pad.ring.color),
        ("", "inner diameter", pad.ring.inner, None),
        ("H", "height", pad.letter.height, pad.letter.color),
        ("", "width", pad.letter.width, None),
        ("", "every stroke", pad.letter.stroke, None),
        ("quiet zone", "square over the H, side", pad.quiet_zone.side, pad.quiet_zone.color),
        (f"tag {tag.family} id {tag.id}", "outer edge of its black border", tag.size, (0, 0, 0)),
        ("", "one of its 8 modules", tag.size / tag_family(tag.family).border_modules, None),
    ]
    rows = (
        (part, what, f"{share:.2f} D", f"{share * 1000:g}", f"{share * 180:g}", " ".join(map(str, color or ())))
        for part, what, share, color in sizes
    )
    return _table(("part", "size", "of D", "D = 1 m, mm", "D = 0.18 m, mm", "colour (sRGB)"), rows)


def tag_picture() -> str:
    """Show the upright tag of pad v1, one character a module, with its white border."""
    tag = PadSpec().tags[0]
    rows = tag_family(tag.family).modules(tag.id)
    return "```text\n" + "\n".join("".join(".#"[not white] for white in row) for row in rows) + "\n```"


def log_messages() -> str:
    """List the message types that are read from MCAP logs."""
    roles = (("pictures", IMAGE_PARSERS), ("calibration", CALIBRATION_PARSERS), ("the drone's poses", POSE_PARSERS))
    rows = []
    for role, parsers in roles:
        for name in dict.fromkeys(name for name, _ in parsers):
            encodings = ", ".join(encoding for other, encoding in parsers if other == name)
            rows.append((role, f"`{name.replace('/', '/msg/')}`", encodings))
    return _table(("for", "message type", "encoded as"), rows)


def raw_encodings() -> str:
    """List the pixel encodings of raw images."""
    return " ".join(f"`{name}`" for name in LAYOUTS)


def video_codecs() -> str:
    """List the formats of a video in a log."""
    return " ".join(f"`{name}`" for name in VIDEO_CODECS)


def bench_parts() -> str:
    """List the parts of the benchmark with what they print."""
    tree = ast.parse((ROOT / "bench" / "__main__.py").read_text(encoding="utf-8"))
    value = next(n.value for n in tree.body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "PARTS")
    parts = ast.literal_eval(value).items()
    return _table(("command", "what it prints"), ((f"`python -m bench {name}`", text) for name, (_, text) in parts))


def _table(head: tuple[str, ...], rows: typing.Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def shipped_tolerance() -> str:
    """Show the tolerance of `landtool eval` where none is given."""
    text = (ROOT / "landtool" / "data" / "tolerance.toml").read_text(encoding="utf-8")
    return f"```toml\n{text.rstrip()}\n```"


PARTS: dict[str, Callable[[], str]] = {
    "commands": command_reference,
    "common options": common_options,
    "settings": settings_reference,
    "detect settings": detect_settings,
    "dehaze settings": dehaze_settings,
    "eval settings": eval_settings,
    "generate settings": generate_settings,
    "train settings": train_settings,
    "domain": domain_settings,
    "modules": module_tree,
    "import order": import_order,
    "pad": pad_table,
    "tag": tag_picture,
    "log messages": log_messages,
    "raw encodings": raw_encodings,
    "video codecs": video_codecs,
    "bench parts": bench_parts,
    "tolerance": shipped_tolerance,
}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
