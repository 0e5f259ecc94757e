"""Arguments at fault: one sentence, exit status 2, and nothing is started."""

from pathlib import Path
from typing import Any

import pytest

from helpers.stack import Tessera


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["run"], "SOURCE"),
        (["run", "kitti:/tmp", "--tiles", "0x3"], "--tiles"),
        (["run", "kitti:/tmp", "--tiles", "2"], "--tiles"),
        (["run", "kitti:/tmp", "--extractors", "-1"], "--extractors"),
        (["run", "kitti:/tmp", "--extractors", "many"], "--extractors"),
        (["run", "kitti:/tmp", "--features", "-5"], "--features"),
        (["run", "kitti:/tmp", "--pace", "0"], "--pace"),
        (["run", "kitti:/tmp", "--frames", "9:9"], "--frames"),
        (["run", "kitti:/tmp", "--sensor", "sonar"], "--sensor"),
        (["run", "kitti:/tmp", "--port", "80"], "--port"),
        (["run", "kitti:/tmp", "--teleport"], "--teleport"),
        (["run", "kitti:/tmp", "--set", "nonsense"], "--set"),
        (["run", "kitti:/no/such/folder"], "/no/such/folder"),
        (["run", "log:/no/such/file"], "/no/such/file"),
        (["run", "kitti:"], "kitti:"),
        (["run", "/some/folder"], "kitti:DIR"),
        (["run", "film:x"], "film:x"),
        (["run", "camera:front"], "camera:N"),
        (["run", "bus:tcp://x"], "bus:"),
        (["replay", "/no/such/file"], "/no/such/file"),
        (["record", "kitti:/no/such/folder", "out.lcmlog"], "/no/such/folder"),
        (["evaluate", "/no/such/file", "/no/such/truth"], "/no/such"),
        (["experiment", "everything"], "extraction"),
        (["map", "/no/such/folder/map.ply"], "/no/such/folder"),
    ],
)
def test_arguments_at_fault(tessera: Tessera, arguments: list[Any], word: str) -> None:
    tessera.command(*arguments).must_refuse(word)


@pytest.mark.parametrize(
    "setting, word",
    [
        ("features.no_such_key=1", "features.no_such_key"),
        ("features.num_features=many", "features.num_features"),
        ("evaluator.out_dir=/tmp", "--out"),
        ("camera.source=kitti:/tmp", "SOURCE"),
        ("tracker.live=true", "--live"),
        ("mapper.polish=true", "--polish"),
        ("tracker.map_delay_frames=0", "map_delay_frames"),
        ("mapper.max_inner_keyframes=0", "mapper"),
    ],
)
def test_settings_at_fault(tessera: Tessera, sequence: Path, setting: str, word: str) -> None:
    tessera.run(f"kitti:{sequence}", "--set", setting).must_refuse(word)


def test_missing_calibration_file(tessera: Tessera, sequence: Path) -> None:
    missing = "/no/such/camera.yaml"
    tessera.run(f"kitti:{sequence}", "--camera", missing).must_refuse(missing)


def test_settings_of_a_stage_at_fault(tessera: Tessera, sequence: Path) -> None:
    """A value that only the stage which uses it can judge."""
    finished = tessera.run(f"kitti:{sequence}", "--set", "loop_closer.vocabulary=/no/such/file")
    assert finished.status == 2, finished.out + finished.err
    assert "/no/such/file" in finished.err
