"""``python -m body_schema``: subcommands, each a module with ``add_arguments(parser)`` and ``run(args) -> int``."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from ._errors import Error

COMMANDS = {
    "import": ("body_schema.recordings.command", "make a table and a calibration file from a bag of ROS or a data set of LeRobot"),
}
"""The module of each subcommand, and what it does. A module is imported only where its subcommand is asked for."""


def main(words: Sequence[str] | None = None) -> int:
    """Run a subcommand: 0 where it is done, 2 where something is wrong with what was asked."""
    words = sys.argv[1:] if words is None else list(words)
    parser = argparse.ArgumentParser(prog="python -m body_schema", description="What goes with body-schema in Python.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (module, what) in COMMANDS.items():
        command = commands.add_parser(name, help=what, description=what)
        if name in words[:1]:
            importlib.import_module(module).add_arguments(command)
    args = parser.parse_args(words)
    try:
        return int(importlib.import_module(COMMANDS[args.command][0]).run(args))
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
