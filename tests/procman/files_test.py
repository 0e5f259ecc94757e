"""Files and folders are written whole or not at all."""

import errno
from pathlib import Path

import pytest

from tessera_cli.files import replacing, replacing_folder


def test_a_full_disk_is_told_with_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left") as failure, replacing(tmp_path / "x.mcap") as written:
        written.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert failure.value.filename == str(tmp_path / "x.mcap")
    assert list(tmp_path.iterdir()) == []


def test_other_errors_keep_what_they_say(tmp_path: Path) -> None:
    with pytest.raises(OSError) as failure, replacing(tmp_path / "x.mcap"):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")
    assert failure.value.filename is None


def test_a_folder_takes_the_place_of_an_earlier_one_when_it_is_complete(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    with replacing_folder(folder) as written:
        (written / "one").write_text("1")
        assert not folder.exists()
    with replacing_folder(folder) as written:
        (written / "two").write_text("2")
    assert [entry.name for entry in folder.iterdir()] == ["two"]


def test_nothing_is_left_of_a_folder_that_could_not_be_written(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "earlier").write_text("0")
    with pytest.raises(OSError), replacing_folder(folder) as written:
        (written / "one").write_text("1")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [entry.name for entry in tmp_path.iterdir()] == ["model"]
    assert [entry.name for entry in folder.iterdir()] == ["earlier"]
