"""ACL against reinforcement learning on one task, from one command.

This is `acl-gym compare` under the name that `make compare` calls.
"""

from __future__ import annotations

import typer

from acl_gym.cli.compare import HELP, CompareCommand, compare

app = typer.Typer(add_completion=False, rich_markup_mode=None)
app.command(
    help=HELP.replace("acl-gym compare", "compare_acl_rl.py"), cls=CompareCommand
)(compare)

if __name__ == "__main__":
    app(prog_name="compare_acl_rl.py")
