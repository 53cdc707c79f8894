"""What the package does from a shell: ``python -m body_schema COMMAND``."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from ._errors import Error

COMMANDS = {
    "print-target": ("print_target", "print tags, boards and cubes in true scale"),
    "intrinsics": ("intrinsics", "calibrate a camera from pictures of a board"),
    "detect": ("detect", "pictures of a target and joint readings as a table to calibrate from"),
    "import": ("import_recording", "a bag of ROS or a data set of LeRobot as a table to calibrate from"),
    "lerobot": ("lerobot", "true joint zeros of an SO-101 of LeRobot from a webcam and a printed tag"),
    "export": ("export", "what a calibration found, in the files of drivers: UR, xArm, PAL, LeRobot, MJCF, tf, xacro"),
}
"""By command its module in ``_commands``, which has ``add_arguments(parser)`` and ``run(args) -> int``, and what it does."""


INTERRUPTED = 130
"""The exit code after Ctrl-C, as shells have it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; gives its exit code: 0 where all went well, 1 where something is left to be set by hand, 2 where what was given is
    wrong, 130 after Ctrl-C.
    """
    listed = "\n".join(f"  {name:<14} {does}" for name, (_, does) in COMMANDS.items())
    parser = argparse.ArgumentParser(
        "python -m body_schema",
        description="Commands of the Python package; the program `body-schema` has others.",
        epilog=f"commands:\n{listed}\n\n`python -m body_schema COMMAND --help` says more.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", metavar="COMMAND", choices=COMMANDS, help=f"one of {', '.join(COMMANDS)}")
    parser.add_argument("rest", metavar="…", nargs=argparse.REMAINDER, help="what the command takes")
    given = list(sys.argv[1:] if arguments is None else arguments)
    chosen = parser.parse_args(given[:1] if given and given[0] in COMMANDS else given)
    module = importlib.import_module(f"._commands.{COMMANDS[chosen.command][0]}", __package__)
    own = argparse.ArgumentParser(
        f"python -m body_schema {chosen.command}", description=module.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    module.add_arguments(own)
    args = own.parse_args(given[1:])
    try:
        return int(module.run(args))
    except Error as error:
        print(f"error: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
    except OSError as error:
        print(f"error: {error.filename}: {error.strerror}" if error.filename else f"error: {error}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
