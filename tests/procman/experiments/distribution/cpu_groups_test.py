"""Control groups: what is written to the kernel, and what it does. Those that write to the real one need root."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.distribution.cpu_groups import CpuGroups, find_hierarchy, quota_and_period_us


def test_quotas_are_at_least_what_the_kernel_takes() -> None:
    assert quota_and_period_us(0.25) == (5000, 20000)
    quota_us, period_us = quota_and_period_us(0.01)
    assert quota_us >= 1000 and quota_us / period_us == pytest.approx(0.01, rel=0.01)
    assert quota_and_period_us(1.0)[0] == -1


def test_the_cpu_controller_is_found_in_both_versions(tmp_path: Path) -> None:
    both = "cgroup /sys/fs/cgroup/memory cgroup rw,memory 0 0\ncgroup /sys/fs/cgroup/cpu cgroup rw,cpu,cpuacct 0 0\n"
    assert find_hierarchy(both) == (Path("/sys/fs/cgroup/cpu"), 1)
    (tmp_path / "cgroup.controllers").write_text("cpuset cpu io\n")
    assert find_hierarchy(f"cgroup2 {tmp_path} cgroup2 rw 0 0\n") == (tmp_path, 2)
    with pytest.raises(UserError, match="no control groups"):
        find_hierarchy("tmpfs /tmp tmpfs rw 0 0\n")


def test_what_version_2_is_told(tmp_path: Path) -> None:
    groups = CpuGroups(2, (tmp_path, 2))
    groups.__enter__()
    groups.set_share(0.1)
    assert (groups.group(1) / "cpu.max").read_text() == "2000 20000"
    groups.set_share(1.0)
    assert (groups.group(0) / "cpu.max").read_text() == "max 20000"
    assert (groups.folder / "cgroup.subtree_control").read_text() == "+cpu"


@pytest.fixture
def groups() -> CpuGroups:
    if os.geteuid() != 0:
        pytest.skip("control groups need root")
    try:
        made = CpuGroups(2)
        made.__enter__()
    except (UserError, RunError) as error:
        pytest.skip(str(error))
    return made


def test_a_process_gets_its_share(groups: CpuGroups) -> None:
    """A fifth of a core: what a core does in 50 ms takes at least 150."""
    try:
        groups.set_share(0.2)
        work = [sys.executable, "-c", "import time\nwhile time.process_time() < 0.05: pass"]
        began = time.monotonic()
        subprocess.run([*groups.words("0"), *work], check=True)
        assert time.monotonic() - began > 0.15
    finally:
        groups.__exit__()
    assert not groups.folder.exists()
