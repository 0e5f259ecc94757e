"""tessera vocabulary train|info: vocabularies of binary words, by tessera-vocabulary."""

import subprocess
from argparse import Namespace
from pathlib import Path

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BIN
from tessera_cli.runs.sources import parse_source

# Options of `train` that the tool takes as they are.
PASSED_ON = ("every", "views", "features", "children", "levels", "seed")


def main(arguments: Namespace) -> int:
    tool = BIN / "tessera-vocabulary"
    if not tool.is_file():
        raise RunFailed(f"{tool} is missing; procman/tessera setup builds it.")
    actions = {"train": train, "info": info}
    finished = subprocess.run([tool, *actions[arguments.action](arguments)], stderr=subprocess.PIPE, text=True)
    if finished.returncode == 2:
        raise UserError(finished.stderr.strip().splitlines()[-1] + ".")
    if finished.returncode != 0:
        raise RunFailed(f"{tool.name} failed: {finished.stderr.strip()[-500:]}")
    return 0


def train(arguments: Namespace) -> list[str]:
    out = Path(arguments.out).expanduser().absolute()
    if out.is_dir() or not out.parent.is_dir():
        raise UserError(f"{out} can't be written: give a file in a folder that exists.")
    options = [f"--{name}={getattr(arguments, name)}" for name in PASSED_ON if getattr(arguments, name) is not None]
    if arguments.camera:
        options.append(f"--camera={Path(arguments.camera).expanduser().absolute()}")
    return ["train", *options, str(out), *(source_text(text) for text in arguments.sources)]


def info(arguments: Namespace) -> list[str]:
    return ["info", str(Path(arguments.path).expanduser().absolute())]


def source_text(text: str) -> str:
    """A folder, or a source that ends by itself."""
    folder = Path(text).expanduser().absolute()
    if folder.is_dir():
        return str(folder)
    if ":" not in text:
        raise UserError(f"'{text}' is neither a folder of photos nor a source such as kitti:DIR.")
    source = parse_source(text)
    if source.is_live:
        raise UserError(f"source '{text}' has no end: record it, and train on the log.")
    return source.text
