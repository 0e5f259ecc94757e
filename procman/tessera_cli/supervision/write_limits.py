"""Where the settings of an order may let processes write: below the run's folder, or where the deputy's own list says.

A trusted key may decide what runs; it must not thereby replace any file of the deputy's user.
"""

from collections.abc import Iterable
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import ROOT
from tessera_cli.settings import Settings

RUN_FOLDER = "evaluator.out_dir"
# Other settings that name what a stage writes.
WRITTEN = ("evaluator.save_map", "map_writer.path", "recorder.path")
# LCM opens other URLs too: a file:// one would be written. Empty ones stand for another bus of these.
URLS = ("bus.main_url", "bus.camera_url", "bus.color_url", "bus.work_url", "bus.map_url", "bus.tile_url")
MAY_BE_EMPTY = ("bus.color_url", "bus.map_url")


def refuse_writing_elsewhere(values: Settings, allowed: Iterable[Path]) -> None:
    """`values`: all settings of the order; `allowed`: folders of the deputy's own list. Raises UserError."""
    for name in URLS:
        is_another = name in MAY_BE_EMPTY and not _value(values, name)
        if not is_another and not _value(values, name).startswith("udpm://"):
            raise UserError(f"{name} = {_value(values, name)}: an order's bus must be udpm://, which writes no file.")
    folders = [folder.resolve() for folder in allowed]
    if out_dir := _value(values, RUN_FOLDER):
        path = (ROOT / out_dir).resolve()
        if not _is_below(path, folders) and any(part.startswith(".") for part in path.parts):
            raise UserError(f"{RUN_FOLDER} = {out_dir}: a run's folder must not be hidden, nor in a hidden folder.")
        folders.append(path)
    for name in WRITTEN:
        text = _value(values, name)
        if text and not _is_below((ROOT / text).resolve(), folders):
            raise UserError(
                f"{name} = {text}: it is not in the run's folder (--out). The deputy's own command list can allow "
                f'more: writes = "{(ROOT / text).parent}";'
            )


def _value(values: Settings, name: str) -> str:
    section, _, key = name.partition(".")
    return str(values[section][key])


def _is_below(path: Path, folders: list[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)
