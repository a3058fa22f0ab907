"""The script ``isv-batch``: says what to install where the subpackage ``batch`` cannot be imported."""

import sys


def main() -> int:
    """Run the command line. Returns the exit status."""
    try:
        from .batch.cli import main as run
    except ImportError as error:
        extras = "install the package isv with its extra 'batch', or with 'ray' for clusters"
        print(f"isv-batch: {error}; {extras} (in a clone: pip install './bindings/python[batch]')", file=sys.stderr)
        return 2
    return run()
