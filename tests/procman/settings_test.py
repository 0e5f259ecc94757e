"""Settings: nobody else reads them, what no program can take is refused, and each that writes is known to deputies."""

from pathlib import Path

import pytest
import yaml

from tessera_cli.errors import UserError
from tessera_cli.settings import DEFAULTS_PATH, without_password, write_settings
from tessera_cli.supervision.write_limits import RUN_FOLDER, URLS, WRITTEN

# Texts that name nothing that is written. A new setting belongs here or into write_limits.py.
OTHER_TEXTS = {
    "bus.channel_prefix",
    "bus.run_dir",  # a deputy puts its own in its place
    "stream.journal_dir",  # and here
    "camera.source",
    "camera.sensor",
    "camera.calibration",
    "camera.pace",
    "dispatcher.tiles",
    "extractor.robots",
    "tracker.replay_log",
    "body.base_from_camera",
    "mapper.load_map",
    "loop_closer.vocabulary",
}


def test_only_the_owner_reads_settings_which_may_hold_a_password(tmp_path: Path) -> None:
    write_settings(["camera.source=rtsp://me:secret@host/1"], tmp_path / "settings.yaml")
    assert (tmp_path / "settings.yaml").stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("value", ["a\0b", "a\x1bb", "a\nb", "a\udcffb"])
def test_control_characters_are_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(UserError, match=r"the setting camera.source=a\\[xnu]\w*b holds a control character"):
        write_settings([f"camera.source={value}"], tmp_path / "settings.yaml")


def test_passwords_are_not_shown() -> None:
    assert without_password("rtsp://me:se:cret@host:554/1?a=b@c") == "rtsp://me:***@host:554/1?a=b@c"
    assert without_password("rtsp://host:554/1") == "rtsp://host:554/1"
    assert without_password("kitti:/data/a@b") == "kitti:/data/a@b"


def test_it_is_known_which_settings_write() -> None:
    sections = yaml.safe_load(DEFAULTS_PATH.read_text())
    texts = {
        f"{section}.{key}"
        for section, keys in sections.items()
        for key, value in keys.items()
        if isinstance(value, str)
    }
    assert texts == {*OTHER_TEXTS, RUN_FOLDER, *WRITTEN, *URLS}
