"""tessera vocabulary: vocabularies for place recognition, trained and examined by the program tessera-vocabulary."""

import argparse
import subprocess
from argparse import Namespace

from tessera_cli.cli.options import SOURCES, add_features
from tessera_cli.cli.parsing import Commands, Parser, add_command, whole_number
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BIN, absolute

EPILOG = """\
examples:
  procman/tessera vocabulary train mine.tvoc photos/ kitti:data/kitti/sequences/03
  procman/tessera vocabulary info config/vocabulary.tvoc
"""
# Options of `train` that are passed on unchanged.
PASSED_ON = ("every", "views", "features", "children", "levels", "seed")


def add_parser(commands: Commands) -> None:
    parser = add_command(commands, "vocabulary", main, "Vocabularies of binary words for place recognition.", EPILOG)
    actions = parser.add_subparsers(metavar="train|info", required=True, dest="action", parser_class=Parser)
    train = actions.add_parser(
        "train",
        help="trains one on images",
        allow_abbrev=False,
        epilog=SOURCES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    train.add_argument("out", metavar="OUT", help="the file to write")
    train.add_argument(
        "sources", metavar="SOURCE", nargs="+", help="a source with an end, see below, or a photo folder"
    )
    train.add_argument("--camera", metavar="FILE.yaml", help="calibration, where a source brings none")
    add_features(train)
    for option, metavar, smallest, largest, text in (
        ("--every", "N", 1, 100000, "one frame in N of a source, default 10"),
        ("--views", "N", 1, 1000, "views cut out of each photo, default 4"),
        ("--children", "K", 2, 255, "into which a node is split, default 10"),
        ("--levels", "L", 1, 10, "of the tree, default 5: at most K^L words"),
        ("--seed", "N", 0, 999999999, "another seed, another vocabulary; default 1"),
    ):
        train.add_argument(option, type=whole_number(smallest, largest), metavar=metavar, help=text)
    info = actions.add_parser("info", help="checks one and shows what is in it", allow_abbrev=False)
    info.add_argument("path", metavar="FILE")


def main(arguments: Namespace) -> int:
    tool = BIN / "tessera-vocabulary"
    if not tool.is_file():
        raise RunError(f"{tool} is missing; procman/tessera setup builds it.")
    words = _train_words(arguments) if arguments.action == "train" else ["info", str(absolute(arguments.path))]
    finished = subprocess.run([tool, *words], stderr=subprocess.PIPE, text=True)
    if finished.returncode == 2:
        raise UserError(finished.stderr.strip().splitlines()[-1] + ".")
    if finished.returncode != 0:
        raise RunError(f"{tool.name} failed: {finished.stderr.strip()[-500:]}")
    return 0


def _train_words(arguments: Namespace) -> list[str]:
    out = absolute(arguments.out)
    if out.is_dir() or not out.parent.is_dir():
        raise UserError(f"{out} can't be written: give a file in a folder that exists.")
    options = [f"--{name}={getattr(arguments, name)}" for name in PASSED_ON if getattr(arguments, name) is not None]
    if arguments.camera:
        options.append(f"--camera={absolute(arguments.camera)}")
    return ["train", *options, str(out), *(_source_text(text) for text in arguments.sources)]


def _source_text(text: str) -> str:
    """A folder of photos, or a source that ends by itself."""
    from tessera_cli.runs.sources import parse_source

    folder = absolute(text)
    if folder.is_dir():
        return str(folder)
    if ":" not in text:
        raise UserError(f"'{text}' is neither a folder of photos nor a source such as kitti:DIR.")
    source = parse_source(text)
    if source.is_live:
        raise UserError(f"source '{text}' has no end: record it, and train on the log.")
    return source.text
