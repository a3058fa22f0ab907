"""``python -m isv.batch``: the command ``isv-batch``."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
