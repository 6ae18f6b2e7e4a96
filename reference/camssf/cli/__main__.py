"""`python -m camssf.cli` is the command `camssf`."""

import sys

from camssf.cli import main

if __name__ == "__main__":
    sys.exit(main())
