"""`python -m identify` is the command `identify`."""

import sys

from identify.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
