"""A stranger forges everything that could hurt, all the time: the run ends as if nobody else were there."""

import json
import subprocess
import sys
from pathlib import Path

from helpers.attacker import ATTACKS, Attacker
from helpers.nodes import FIRST_NODE_PORT, MakeNode
from helpers.stack import ROOT, RUN_TIMEOUT_S, Finished, Tessera, environment, wait_for_a_pose
from tessera_cli.experiments.distribution.lan import Lan
from tessera_cli.lcm_bus import bus_url
from tessera_cli.membership import run_dir_of

HASHES = ("trajectory_sha256", "map_sha256")
# Of each attack while one run lasts: it repeats them all several times a second.
MIN_REPETITIONS = 3


def start_attacks(port: int, *options: object, prefix: tuple[str, ...] = ()) -> "subprocess.Popen[str]":
    words = [*prefix, sys.executable, "-m", "helpers.attacker", str(port), str(RUN_TIMEOUT_S), *map(str, options)]
    return subprocess.Popen(
        words,
        env={**environment(), "PYTHONPATH": f"{ROOT / 'procman'}:{ROOT / 'tests'}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def end_attacks(attacks: "subprocess.Popen[str]") -> dict[str, int]:
    """How many forgeries were sent, by the name of the attack."""
    attacks.send_signal(2)
    out, err = attacks.communicate(timeout=10)
    assert attacks.returncode == 0, err
    return json.loads(out)


def must_be_unharmed(folder: Path, reference_run: Finished, num_sent: dict[str, int]) -> None:
    assert len(ATTACKS) >= 40
    assert set(num_sent) == set(ATTACKS) and min(num_sent.values()) >= MIN_REPETITIONS, num_sent
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("ended", "frames", "frames_tracked", "frames_dropped", *HASHES):
        assert summary[key] == reference_run.summary[key], key
    assert summary["messages_lost"] == summary["messages_undecodable"] == 0
    assert summary["messages_of_strangers"] > 1000
    assert summary["warnings"] == []


def test_no_forgery_changes_stalls_or_ends_a_run(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    attacks = start_attacks(port)
    run = tessera.start("run", f"kitti:{sequence}", "--extractors", 2, "--pace", "0.5", "--port", port, "--out", folder)
    try:
        out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    finally:
        run.kill()
        num_sent = end_attacks(attacks)
    assert run.returncode == 0, out
    assert "of strangers were passed over" in out
    must_be_unharmed(folder, reference_run, num_sent)


def test_nor_a_list_on_four_nodes(
    make_node: MakeNode, lan: Lan, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    port = FIRST_NODE_PORT - 100
    nodes = [make_node(deputy=f"node{i}", prefix=tuple(lan.at(i)), is_lan=True, port=port).start() for i in range(1, 5)]
    attacks = start_attacks(port, 1, prefix=tuple(lan.at(4)))
    options = ("--set", f"camera.source=kitti:{sequence}", "--set", "camera.pace=0.5")
    try:
        finished = nodes[0].command(
            "up", ROOT / "procman" / "lan.pmd", "--script", "run", "--out", tmp_path / "out", *options
        )
    finally:
        num_sent = end_attacks(attacks)
    assert finished.returncode == 0, finished.stderr
    must_be_unharmed(tmp_path / "out", reference_run, num_sent)


def test_a_member_that_asks_without_end_and_tells_nonsense_stalls_nobody(
    tessera: Tessera, sequence: Path, reference_run: Finished, own_keys: Path
) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    words = ("run", f"kitti:{sequence}", "--extractors", 1, "--pace", "0.5", "--port", port, "--out", folder)
    run = tessera.start(*words)
    try:
        wait_for_a_pose(port)
        secret = run_dir_of(own_keys, bus_url(port), "").secret()
        assert secret is not None
        attacker = Attacker(port, secret=secret)
        while run.poll() is None:
            attacker.listen(0.05)
            for name in ("MAP_REQUEST, many", "REPAIR, many", "POSE in sequence: a frame far beyond"):
                attacker.attack(name, publisher="liar")
        out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    finally:
        run.kill()
    assert run.returncode == 0, out
    assert min(attacker.num_sent.values()) >= MIN_REPETITIONS
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("ended", "frames", "frames_tracked", *HASHES):
        assert summary[key] == reference_run.summary[key], key
    assert summary["messages_undecodable"] > 0, "the nonsense was refused and counted"
