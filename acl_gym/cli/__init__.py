"""The command line: `acl-gym`, or `python -m acl_gym`.

Showing help and answering a wrong name import neither torch nor Numba nor matplotlib:
each command imports what it needs when it runs.
"""


def main() -> None:
    """The entry point of the command."""
    from acl_gym.cli.app import app

    app(prog_name="acl-gym")
