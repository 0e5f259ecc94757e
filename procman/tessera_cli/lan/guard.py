"""python -m tessera_cli.lan.guard FOLDER: waits until its deputy is gone, however that went, and ends what it left.

The deputy holds the other end of our standard input, which the kernel closes when it dies.
"""

import os
import signal
import sys

from tessera_cli.lan.tree import kill_marked


def main() -> int:
    # Who ends the deputy's whole group must not end the guard before its work.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while os.read(0, 4096):
        pass
    return 0 if kill_marked(f"{sys.argv[1]}/") else 1


if __name__ == "__main__":
    sys.exit(main())
