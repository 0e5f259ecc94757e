"""python -P -m tessera_cli COMMAND ...: what procman/tessera runs."""

import sys

from tessera_cli.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
