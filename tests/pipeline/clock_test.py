"""Order lives by something that clocks can't break: a board without a clock of its own begins at 1970 at every boot."""

import json
import os
import signal
import subprocess
from pathlib import Path

import lcm
import pytest

from helpers.stack import NUM_FRAMES, RUN_TIMEOUT_S, Finished, Tessera, pids_of, wait_for

# Preloaded: processes that are started while the file SET_BACK exists live a day in the past.
SHIM = """
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

static int is_set_back;
__attribute__((constructor)) static void look(void) {
  const char* path = getenv("SET_BACK");
  is_set_back = path && access(path, F_OK) == 0;
}
int clock_gettime(clockid_t clock, struct timespec* now) {
  const int status = syscall(SYS_clock_gettime, clock, now);
  if (clock == CLOCK_REALTIME && is_set_back) now->tv_sec -= 86400;
  return status;
}
"""


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shim")
    (folder / "clock.c").write_text(SHIM)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", folder / "clock.so", folder / "clock.c"], check=True)
    return folder / "clock.so"


def test_stages_started_again_under_a_clock_that_was_set_back_change_nothing(
    tessera: Tessera, sequence: Path, reference_run: Finished, shim: Path, tmp_path: Path
) -> None:
    port, folder, mark = tessera.next_port(), tessera.next_folder(), tmp_path / "back"
    words = ("run", f"kitti:{sequence}", "--extractors", 1, "--pace", "0.5", "--port", port, "--out", folder)
    run = tessera.start(*words, LD_PRELOAD=str(shim), SET_BACK=str(mark))
    poses = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data)).set_queue_capacity(1000)
    try:
        wait_for(lambda: (bus.handle_timeout(20), len(poses) > NUM_FRAMES // 4)[1], "poses")
        mark.touch()
        for stage in ("mapper", "dispatcher", "reassembler", "extractor"):
            os.kill(pids_of(folder, stage)[0], signal.SIGKILL)
        out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    finally:
        run.kill()
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    assert len(summary["warnings"]) == 4, "each was killed and started again"
    for key in ("ended", "frames", "frames_tracked", "frames_dropped", "trajectory_sha256", "map_sha256"):
        assert summary[key] == reference_run.summary[key], key
