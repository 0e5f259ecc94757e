"""tessera keys: whose orders deputies obey."""

from argparse import Namespace
from typing import TYPE_CHECKING

from tessera_cli.cli.parsing import Commands, Parser, add_command
from tessera_cli.console import say

if TYPE_CHECKING:
    from tessera_cli.cluster.keys import KeyRing


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "keys",
        main,
        "Whose orders the deputies of this user obey, and whose deputies it believes; lists them.",
        "examples:\n  procman/tessera keys\n  procman/tessera keys trust base 3q2+7w...=\n",
    )
    actions = parser.add_subparsers(metavar="list|make|trust|revoke", dest="action", parser_class=Parser)
    actions.add_parser("list", help="this user's public key and all trusted ones; the default", allow_abbrev=False)
    actions.add_parser("make", help="a new key instead of this user's own", allow_abbrev=False)
    trust = actions.add_parser("trust", help="obey another user's orders", allow_abbrev=False)
    trust.add_argument("name", metavar="NAME", help="a name for the key")
    trust.add_argument("key", metavar="KEY", help="what `tessera keys` shows there")
    revoke = actions.add_parser("revoke", help="obey them no longer", allow_abbrev=False)
    revoke.add_argument("name", metavar="NAME")


def main(arguments: Namespace) -> int:
    from tessera_cli.cluster.keys import KeyRing, key_folder

    ring = KeyRing(key_folder())
    match arguments.action:
        case "trust":
            ring.trust(arguments.name, arguments.key)
            say(f"deputies of this user now obey {arguments.name}.")
        case "revoke":
            ring.revoke(arguments.name)
            say(f"deputies of this user no longer obey {arguments.name}.")
        case "make":
            ring.make()
            say(f"a new key is in {ring.secret_path}; the old one is no longer trusted here.")
    _print(ring)
    return 0


def _print(ring: "KeyRing") -> None:
    from tessera_cli.cluster.keys import to_text

    print(f"this user's orders are signed with  {ring.own_public_key()}")
    print("orders obeyed by deputies of this user:")
    for name, key in ring.trusted().items():
        print(f"  {name:16s} {to_text(key)}")
    print("To be obeyed on another node, do there: procman/tessera keys trust NAME KEY")
