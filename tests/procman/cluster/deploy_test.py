"""Copies to nodes: what nodes that lack something are told, and a copy to this machine by an sshd of the test's own."""

import getpass
import os
import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from helpers.stack import ROOT, environment, wait_for
from tessera_cli.cluster import deploy
from tessera_cli.cluster.keys import KeyRing
from tessera_cli.cluster.node_facts import (
    NodeFacts,
    Problem,
    Requirements,
    copy_blockers,
    missing_requirements,
    own_key_name,
    parse_facts,
    read_packages,
    warnings,
)
from tessera_cli.errors import UserError
from tessera_cli.files import python_command

TOLD = """host board1
architecture aarch64
system debian 12
flags fp asimd
rmem_max 212992
route 000000E0 000000F0
program rsync
program apt-get
package cmake
trusted me AAAA
home /home/pi/tessera
deployed CMakeLists.txt
python /home/pi/tessera /usr/bin/python3.11 0123abcd  -
versions {"OpenCV": "4.6.0"}
build current
"""
REQUIRED = Requirements(parse_facts(TOLD.replace("4.6.0", "4.10.0")), ("cmake",), "0123abcd", "AAAA", "me@base")


def sentences(problems: list[Problem]) -> str:
    return "; ".join(problem.sentence for problem in problems)


def test_a_node_that_has_all_is_ready() -> None:
    facts = parse_facts(TOLD)
    assert facts.deployed == ["CMakeLists.txt"] and facts.rmem_max == 212992
    assert copy_blockers(facts, REQUIRED, True) == [] and missing_requirements(facts, REQUIRED) == []
    small, other = warnings(facts, REQUIRED)
    assert "net.core.rmem_max=4194304" in small and "its OpenCV is 4.6.0 and this machine's 4.10.0" in other


@pytest.mark.parametrize(
    "line, other, words",
    [
        ("package cmake", "", "packages are missing: cmake"),
        ("0123abcd", "4567", ".venv has other packages"),
        ("build current", "build old", "older than its sources"),
        ("build current", "", "it has no build"),
        ("build current", "build current\nlibrary liblcm.so.1", "don't find liblcm.so.1"),
        ("route 000000E0 000000F0", "route 0000A8C0 00FFFFFF", "no route for multicast"),
        (
            "trusted me AAAA",
            "trusted other BBBB",
            "do there, when it is set up: procman/tessera keys trust me@base AAAA",
        ),
        ("trusted me AAAA", "trusted me BBBB\ntrusted base AAAA", "do here: procman/tessera keys trust me@board1 BBBB"),
    ],
)
def test_each_thing_that_is_missing_is_named(line: str, other: str, words: str) -> None:
    found = missing_requirements(parse_facts(TOLD.replace(line, other)), REQUIRED)
    assert len(found) == 1 and words in found[0].sentence


@pytest.mark.parametrize(
    "line, other, is_built, words",
    [
        ("aarch64", "riscv64", False, "Tessera is built for x86_64 and aarch64"),
        (
            "aarch64",
            "x86_64",
            True,
            "its CPU is x86_64 and this machine's aarch64: deploy without --built, and build there",
        ),
        ("flags fp asimd\n", "", False, ""),
        ("debian 12", "ubuntu 24.04", True, "its system is ubuntu 24.04 and this machine's debian 12"),
        ("program rsync", "", False, "sudo apt-get install rsync"),
        ("program apt-get", "", False, "no apt-get"),
        ("build current", "git yes", False, "/home/pi/tessera is a git checkout"),
    ],
)
def test_what_keeps_anything_from_being_copied_is_named(line: str, other: str, is_built: bool, words: str) -> None:
    found = sentences(copy_blockers(parse_facts(TOLD.replace(line, other)), REQUIRED, is_built))
    assert words in found and bool(found) == bool(words)


def test_an_old_cpu_is_told() -> None:
    facts = NodeFacts(architecture="x86_64", flags={"avx2", "fma"}, programs={"rsync", "apt-get"})
    assert sentences(copy_blockers(facts, REQUIRED, False)) == "its CPU lacks bmi2: Tessera needs x86-64-v3"


def test_lines_that_make_no_sense_are_left_out() -> None:
    facts = parse_facts("rmem_max lots\nroute 1\nversions {\nversions 3\ntrusted x\nnonsense\n\n\x00")
    assert facts == NodeFacts()


@pytest.mark.parametrize(
    "text", ["", "-oProxyCommand=x", "a b", "node:~/x", "node:../x", "node:/", "node:.", "node:$(x)", "@node"]
)
def test_what_is_no_node_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="is no node"):
        deploy.parse_node(text)


def test_nodes_are_read() -> None:
    assert [
        (node.login, node.folder)
        for node in map(deploy.parse_node, ("pi@board1", "10.0.0.2:/opt/tessera/", "n:work/t"))
    ] == [("pi@board1", "tessera"), ("10.0.0.2", "/opt/tessera"), ("n", "work/t")]


def test_what_an_earlier_deploy_brought_and_is_no_more_goes_but_nothing_outside() -> None:
    deployed = ["a.cc", "old.cc", "../../etc/passwd", "/etc/passwd", "x/../../y", "build/.prebuilt"]
    assert deploy.obsolete_files(deployed, ["a.cc"], False) == ["old.cc", "build/.prebuilt"]
    assert deploy.obsolete_files(deployed, ["a.cc"], True) == ["old.cc"]


def test_packages_are_those_of_the_list() -> None:
    packages = read_packages(ROOT / "procman" / "packages.txt")
    assert "cmake" in packages and all(" " not in name and "#" not in name for name in packages)


class Sshd:
    """On loopback, with keys of its own; what it is asked for is done as the user of the test."""

    def __init__(self, folder: Path, keys: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        for name in ("host", "user"):
            subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
        shutil.copy(folder / "user.pub", folder / "authorized")
        (folder / "config").write_text(
            f"Port {self._port}\nListenAddress 127.0.0.1\n"
            f"HostKey {folder / 'host'}\nAuthorizedKeysFile {folder / 'authorized'}\n"
            f'StrictModes no\nUsePAM no\nPidFile none\nPasswordAuthentication no\nSetEnv TESSERA_KEYS="{keys}"\n'
        )
        if os.geteuid() == 0:
            Path("/run/sshd").mkdir(exist_ok=True)
        self._process = subprocess.Popen(
            [shutil.which("sshd", path=SSHD_PATH) or "sshd", "-D", "-e", "-f", folder / "config"],
            stderr=subprocess.DEVNULL,
        )
        self.command = (
            f"ssh -p {self._port} -i {folder / 'user'} -o IdentitiesOnly=yes -o StrictHostKeyChecking=no "
            f"-o LogLevel=ERROR -o UserKnownHostsFile={folder / 'known'} -F none"
        )
        wait_for(self._answers, "the sshd")

    def _answers(self) -> bool:
        return (
            subprocess.run([*self.command.split(), "127.0.0.1", "true"], capture_output=True).returncode == 0
            or self._process.poll() is not None
        )

    def end(self) -> None:
        self._process.terminate()
        self._process.wait()


SSHD_PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


@dataclass
class DeployTarget:
    """A folder of this machine, and the keys that deputies there trust."""

    deploy: Callable[..., "subprocess.CompletedProcess[str]"]
    folder: Path
    keys: Path


@pytest.fixture
def node(tmp_path: Path) -> Iterator[DeployTarget]:
    """`deploy(options...)` to a folder of this machine."""
    for program in ("sshd", "ssh", "ssh-keygen", "rsync", "git"):
        if not shutil.which(program, path=SSHD_PATH):
            pytest.skip(f"{program} is not installed: sudo apt-get install openssh-server rsync git")
    (tmp_path / "ssh").mkdir()
    sshd = Sshd(tmp_path / "ssh", tmp_path / "keys of the node")
    folder = tmp_path / "node"

    def run(*options: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [*python_command("tessera_cli"), "deploy", f"127.0.0.1:{folder}", "--ssh", sshd.command, *options],
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=300,
        )

    yield DeployTarget(deploy=run, folder=folder, keys=tmp_path / "keys of the node")
    sshd.end()


def test_sources_are_copied_once_and_what_is_missing_is_told(node: DeployTarget, own_keys: Path) -> None:
    looked = node.deploy("--dry-run")
    assert looked.returncode == 1 and "files would be copied" in looked.stdout and not node.folder.exists(), (
        looked.stderr
    )
    first = node.deploy()
    assert first.returncode == 1, first.stderr
    ring = KeyRing(own_keys)
    own_key = ring.own_public_key()
    for words in (
        "no Python environment",
        "no build",
        f"procman/tessera keys trust {own_key_name(getpass.getuser(), os.uname().nodename)} {own_key}",
    ):
        assert words in first.stdout
    listed = (node.folder / ".tessera-deployed").read_text().split()
    assert all((node.folder / name).read_bytes() == (ROOT / name).read_bytes() for name in listed)
    assert os.access(node.folder / "procman" / "tessera", os.X_OK) and not (node.folder / ".git").exists()
    node.keys.mkdir()
    (node.keys / "trusted_keys").write_text(f"base {own_key}\n")
    (node.folder / "README.md").write_text("another")
    (node.folder / ".tessera-deployed").write_text("\n".join([*listed, "old.cc"]) + "\n")
    (node.folder / "old.cc").write_text("no longer there")
    (node.folder / "own.txt").write_text("the node's own")
    second = node.deploy()
    assert (
        f"1 of {len(listed)} files copied" in second.stdout
        and "1 removed" in second.stdout
        and "keys trust" not in second.stdout
    )
    assert not (node.folder / "old.cc").exists() and (node.folder / "own.txt").exists()


def test_a_build_is_old_when_a_source_is_newer(node: DeployTarget) -> None:
    node.deploy()
    (node.folder / "build").mkdir()
    (node.folder / "build" / ".built").touch()
    current = node.deploy("--dry-run")
    assert "no build" not in current.stdout and "older than its sources" not in current.stdout
    (node.folder / "modules" / "core" / "errors.h").write_text("// another\n")
    for _ in range(2):
        assert "its build is older than its sources" in node.deploy().stdout


def test_a_built_tree_runs_where_it_was_copied_to(node: DeployTarget) -> None:
    if not (ROOT / "build" / "bin" / "tessera-tracker").exists() or not (ROOT / ".venv").is_dir():
        pytest.skip("the stages are not built: procman/tessera setup builds them")
    finished = node.deploy("--built")
    assert (
        finished.returncode == 1
        and "no build" not in finished.stdout
        and (node.folder / "build" / ".prebuilt").exists()
    ), finished.stdout
    (node.folder / ".venv").symlink_to(ROOT / ".venv")  # what setup would make
    told = subprocess.run([node.folder / "build" / "bin" / "tessera-tracker", "--help"], capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    node.deploy()
    assert (
        not (node.folder / "build" / ".prebuilt").exists()
        and not (node.folder / "build" / "bin" / "tessera-tracker").exists()
    )


def test_nodes_that_cannot_be_reached_are_told(node: DeployTarget) -> None:
    finished = subprocess.run(
        [*python_command("tessera_cli"), "deploy", "127.0.0.1", "--ssh", "ssh -p 1"],
        env=environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert finished.returncode == 1 and "127.0.0.1: can't be reached: " in finished.stdout
