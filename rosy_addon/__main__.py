"""``python -m rosy_addon VERB ...``: the command line in plain Python."""

import sys

try:
    from .cli import main

    status = main(sys.argv[1:], prog="python -m rosy_addon")
except KeyboardInterrupt:  # while modules are imported
    print("rosy: stopped", file=sys.stderr)
    status = 130
sys.exit(status)
