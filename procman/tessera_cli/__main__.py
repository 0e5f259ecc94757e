"""python -m tessera_cli COMMAND ...: exit status 0 done, 1 it failed, 2 the arguments or the input are at fault."""

import importlib
import os
import sys

from tessera_cli.cli.arguments import parse_arguments
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
    except BrokenPipeError:
        # Whoever reads our output has enough of it, as `head` does; Python would complain once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


if __name__ == "__main__":
    sys.exit(main())
