"""The script ``isv-batch``: says what to install where the subpackage ``batch`` cannot be imported."""

import sys


def main() -> int:
    """Run the command line. Returns the exit status."""
    try:
        from .batch.cli import main as run
    except ImportError as error:
        print(f"isv-batch: {error}; pip install 'isv[batch]', or 'isv[ray]' for clusters", file=sys.stderr)
        return 2
    return run()
