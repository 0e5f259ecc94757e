"""What the launcher says of a process is that process's own."""

import time

from tessera_cli.processes import StageProcess


def test_peak_memory_is_the_process_own_and_not_what_the_launcher_had(tmp_path):
    ballast = bytearray(b"x" * 100_000_000)
    process = StageProcess("sleeper", ["sleep", "0.3"], tmp_path / "sleeper.log")
    process.start()
    while process.poll() is None:
        time.sleep(0.01)
    assert len(ballast) > 0
    assert 0 < process.max_rss_mb < 50
