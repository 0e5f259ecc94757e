"""What stages keep for their successors is removed with the run."""

from pathlib import Path

import pytest

from tessera_cli.runs.run_folder import SETTINGS_FILE, keeps_journal, leave_journals, remove_journals


def test_journals_are_removed_and_nothing_else(tmp_path: Path) -> None:
    for name in ("mapper.journal", "tracker.journal.part", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / SETTINGS_FILE).write_text(f"stream: {{journal_dir: '{tmp_path}'}}\n")
    assert keeps_journal(tmp_path, "mapper") and not keeps_journal(tmp_path, "camera")
    remove_journals({"stream": {"journal_dir": str(tmp_path)}})
    assert not keeps_journal(tmp_path, "mapper")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", SETTINGS_FILE]


def test_what_cant_be_removed_is_told_when_the_run_is_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mapper.journal").mkdir()  # can't be unlinked, as on a disk that has become read-only
    values = {"stream": {"journal_dir": str(tmp_path)}}
    with pytest.raises(OSError):
        remove_journals(values)
    leave_journals(values)
    assert "mapper.journal" in capsys.readouterr().out
