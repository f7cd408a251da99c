"""`landtool completion SHELL`: the script that completes landtool's commands and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from landtool_cli.console import Console, pass_console

# Where each shell looks for it
_INSTALL = {
    "bash": "landtool completion bash > ~/.local/share/bash-completion/completions/landtool",
    "zsh": "landtool completion zsh > ~/.zfunc/_landtool  (with fpath+=~/.zfunc before compinit in ~/.zshrc)",
    "fish": "landtool completion fish > ~/.config/fish/completions/landtool.fish",
}


@click.command("completion", epilog="\b\nTo install:\n" + "\n".join(f"  {line}" for line in _INSTALL.values()))
@click.argument("shell", metavar="SHELL", type=click.Choice(list(_INSTALL)))
@click.pass_context
@pass_console
def command(console: Console, ctx: click.Context, shell: str) -> None:
    """Print the completion script of SHELL: bash, zsh or fish."""
    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"click has no completion for {shell}", ctx)
    completion = kind(ctx.find_root().command, {}, "landtool", "_LANDTOOL_COMPLETE")
    # not source(): for bash it asks the installed bash for its version, though the script may be for another machine
    console.result(completion.source_template % completion.source_vars())
