"""The command `camssf`, also `python -m camssf`."""

import sys


def main() -> int:
    """Run the command line and return its exit status."""
    try:
        from camssf.cli import main as command_line  # inside the try: Ctrl-C may come during the import

        return command_line()
    except KeyboardInterrupt:
        return 130  # as `camssf.cli.INTERRUPTED`


if __name__ == "__main__":
    sys.exit(main())
