"""``python -m tests.fuzz --cases 1000 --seed 1``: run random hostile cases."""

import sys

from .runner import main

if __name__ == "__main__":
    sys.exit(main())
