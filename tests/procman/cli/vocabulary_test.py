"""tessera vocabulary: what it trains is the same each time, and whatever is wrong is said in one sentence."""

from pathlib import Path
from typing import Any

import pytest

from helpers.stack import Tessera


def test_trains_on_a_source_and_a_folder(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    files = [tmp_path / "a.tvoc", tmp_path / "b.tvoc"]
    photos = next(path.parent for path in sorted(sequence.rglob("*")) if path.suffix == ".pgm")
    for file in files:
        tessera.command(
            "vocabulary", "train", file, f"kitti:{sequence}", photos, "--every", 20, "--views", 1, "--levels", 2
        ).must_end_well()
    assert files[0].read_bytes() == files[1].read_bytes()
    told = tessera.command("vocabulary", "info", files[0]).must_end_well().out
    assert "words 100," in told
    assert "trained on" in told


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["train", "/tmp/v.tvoc", "/no/such/folder"], "/no/such/folder"),
        (["train", "/tmp/v.tvoc", "camera:0"], "camera:0"),
        (["train", "/no/such/folder/v.tvoc", "sim:room"], "/no/such/folder"),
        (["train", "/tmp/v.tvoc", "sim:nowhere"], "nowhere"),
        (["train", "/tmp/v.tvoc", "sim:room", "--levels", "0"], "--levels"),
        (["info", "/no/such/file.tvoc"], "/no/such/file.tvoc"),
        (["info", __file__], "not a vocabulary"),
        ([], "train|info"),
    ],
)
def test_refuses(tessera: Tessera, arguments: list[Any], word: str) -> None:
    tessera.command("vocabulary", *arguments).must_refuse(word)


def test_refuses_a_folder_without_photos(tessera: Tessera, tmp_path: Path) -> None:
    tessera.command("vocabulary", "train", tmp_path / "v.tvoc", tmp_path).must_refuse("no image")
