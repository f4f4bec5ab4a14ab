"""``python -m rosy_addon VERB ...``: the command line in plain Python."""

import sys

from .cli import main

sys.exit(main(sys.argv[1:], prog="python -m rosy_addon"))
