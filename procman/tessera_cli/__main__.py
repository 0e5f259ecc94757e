"""python -m tessera_cli COMMAND ...: exit status 0 done, 1 it failed, 2 the arguments or the input are at fault."""

import importlib
import sys

from tessera_cli.arguments import parse_arguments
from tessera_cli.errors import RunFailed, UserError


def main() -> int:
    arguments = parse_arguments(sys.argv[1:])
    try:
        # Imported late: plots and metrics take a second to load, and `run` must start at once.
        return importlib.import_module(f"tessera_cli.{arguments.module}").main(arguments)
    except UserError as error:
        print(f"tessera: {error}", file=sys.stderr)
        return 2
    except RunFailed as error:
        print(f"tessera: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("tessera: interrupted.", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
