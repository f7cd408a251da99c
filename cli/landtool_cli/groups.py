"""Commands that hold commands."""

from __future__ import annotations

import difflib

import click

from landtool.errors import UsageError
from landtool_cli.console import Console


class NamingGroup(click.Group):
    """A group that answers a wrong name with the nearest right one, and no name with its help."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command to call. Raises UsageError naming the nearest one when there is none."""
        names = self.list_commands(ctx)
        if args[0] not in names and not args[0].startswith("-") and not ctx.resilient_parsing:
            near = difflib.get_close_matches(args[0], names, n=1, cutoff=0.0)[0]
            hint = f"did you mean '{near}'? All commands: {', '.join(names)}"
            raise UsageError(f"no such command '{args[0]}'", hint=hint)
        return super().resolve_command(ctx, args)


def help_if_alone(ctx: click.Context) -> None:
    """Print a group's help when none of its commands was called."""
    if ctx.invoked_subcommand is None:
        ctx.ensure_object(Console).result(ctx.get_help())
