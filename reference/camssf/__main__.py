"""The command `camssf`, also `python -m camssf`."""

import sys


def main() -> int:
    """Run the command line and return its exit status."""
    try:
        from camssf.cli import main as command_line  # here, since Ctrl-C may come while it loads

        return command_line()
    except KeyboardInterrupt:
        return 130  # as `camssf.cli.INTERRUPTED`


if __name__ == "__main__":
    sys.exit(main())
