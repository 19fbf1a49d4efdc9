"""The list of commands in `flexfem --help`, by what people want."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

GROUPS = {
    "Start": ("new", "check", "view", "summary"),
    "Ask a stage": ("stiffness", "solve", "formulas"),
    "Compare with finite elements": ("verify", "plot", "budget", "converge", "claims"),
    "Drive and reach": ("command", "workspace"),
    "Vibration, heat and life": ("modes", "drift", "life"),
    "Measure": ("experiment", "identify"),
    "Many designs": ("study", "design"),
    "Pass on": ("export", "mesh", "report", "schema"),
    "Check and trust": ("regression", "baseline"),
}
OTHERS = "Other commands"
OF_THE_SHELL = ("--install-completion", "--show-completion")
SENTENCE = 400  # letters, of which a longer one shows the first


class GroupedCommands(TyperGroup):
    """A group whose help has its commands in sections."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse the name of a shell, of which no notice would be taken: completion is of the shell that asks."""
        if args and args[0] in OF_THE_SHELL and args[1:]:
            ctx.fail(f"{args[0]} {args[1]}: expected nothing behind it, it is of the shell in which it is run")
        return super().parse_args(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the sections, each command with its first sentence."""
        names = self.list_commands(ctx)
        known = {name for group in GROUPS.values() for name in group}
        for title, group in {**GROUPS, OTHERS: [name for name in names if name not in known]}.items():
            rows = [(name, self.commands[name].get_short_help_str(SENTENCE)) for name in group if name in names]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)
