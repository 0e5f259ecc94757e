"""What a run prints when it is over."""

from pathlib import Path
from typing import Any

import pytest

from helpers.made_run import write_run
from tessera_cli.report.run_report import present_run
from tessera_cli.runs.run_folder import read_run

IN_PARTS = {
    "map_parts": 2,
    "parts": [
        {"frames": 9, "keyframes": 3, "is_main": False},
        {"frames": 100, "keyframes": 21, "is_main": True},
    ],
}


@pytest.mark.parametrize(
    "change, sentence",
    [
        (IN_PARTS, "warning: The map is in 2 parts that nothing joins"),
        ({"warnings": ["mapper was killed."]}, "warning: mapper was killed."),
        ({"not_written": ["no room for map.ply."]}, "warning: no room for map.ply."),
    ],
)
def test_the_last_words_have_what_is_to_be_doubted(tmp_path: Path, change: dict[str, Any], sentence: str) -> None:
    folder = write_run(tmp_path / "run", **change)
    assert sentence in present_run(read_run(folder), folder)
