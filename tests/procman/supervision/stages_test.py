"""Deputies with the real stages: the same results as `tessera run`, on one node and on four, whatever fails."""

import json
import os
import signal
from pathlib import Path

import pytest

from helpers.nodes import FIRST_NODE_PORT, MakeNode, Node
from helpers.stack import ROOT, Finished, must_succeed, wait_for
from tessera_cli.experiments.distribution.lan import Lan
from tessera_cli.files import BIN

pytestmark = pytest.mark.skipif(
    not (BIN / "tessera-tracker").exists(), reason="the stages are not built: procman/tessera setup builds them"
)
STAGES = ("camera", "dispatcher", "reassembler", "tracker", "mapper", "loop_closer", "global_adjuster", "evaluator")
HASHES = ("trajectory_sha256", "map_sha256")


def run_script(node: Node, name: str, sequence: Path, out: Path, *options: object) -> list[object]:
    return [
        "up",
        ROOT / "procman" / name,
        "--script",
        "run",
        "--set",
        f"camera.source=kitti:{sequence}",
        "--out",
        out,
        *options,
    ]


def must_equal(folder: Path, reference_run: Finished) -> None:
    facts = json.loads((folder / "run.json").read_text())
    assert {key: facts[key] for key in HASHES} == {key: reference_run.summary[key] for key in HASHES}


def test_a_script_runs_the_whole_stack_on_one_machine(
    make_node: MakeNode, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    node = make_node(deputy=os.uname().nodename).start()
    finished = node.command(*run_script(node, "local.pmd", sequence, tmp_path / "out"))
    assert finished.returncode == 0 and "script run ended well" in finished.stdout, finished.stderr
    must_equal(tmp_path / "out", reference_run)
    assert node.marked() == []
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (
        set(summary) == set(reference_run.summary)
        and summary["source"] == f"kitti:{sequence}"
        and summary["extractors"] == 2
    )
    assert set(summary["cpu_s"]) == set(summary["max_rss_mb"]) == {*STAGES, "extractor_0", "extractor_1"}
    assert summary["wall_s"] > 0 and summary["cpu_s"]["tracker"] > 0 and summary["max_rss_mb"]["tracker"] > 1
    assert summary["warnings"] == [] and summary["extractor_restarts"] == 0
    assert (
        tmp_path / "out" / "report.html"
    ).is_file() and f"report: {tmp_path / 'out' / 'report.html'}" in finished.stdout


def test_two_robots_have_a_stack_each_on_one_deputy(
    make_node: MakeNode, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    node = make_node(deputy=os.uname().nodename).start()
    scripts = []
    for name in ("A", "B"):
        options = ("--name", name, "--set", f"bus.channel_prefix={name}_")
        scripts.append(node.start_command(*run_script(node, "local.pmd", sequence, tmp_path / name, *options)))
    try:
        for script in scripts:
            must_succeed(script)
    finally:
        for script in scripts:
            script.kill()
    for name in ("A", "B"):
        must_equal(tmp_path / name, reference_run)
    assert node.marked() == []


def test_a_stage_that_says_nothing_hangs_and_is_started_again(make_node: MakeNode) -> None:
    node = make_node().start()
    assert node.up('cmd "extractor" { host = "node1"; hang_timeout_s = 2; }').returncode == 0
    os.kill(node.processes()["extractor"]["pid"], signal.SIGSTOP)
    wait_for(
        lambda: node.processes()["extractor"]["starts"] == 2 and node.processes()["extractor"]["state"] == "ready",
        "its return",
    )
    assert node.processes()["extractor"]["reason"] == "sent no status for 2 s"


def test_a_stage_that_cannot_become_ready_is_told_with_its_reason(make_node: MakeNode) -> None:
    node = make_node().start()
    up = node.up(
        'cmd "camera" { host = "node1"; auto_respawn = never; }', "--set", "camera.source=kitti:/no/such/folder"
    )
    assert (
        up.returncode == 1
        and "camera on node1 is failed: ended with status 2: tessera-camera: " in up.stderr
        and "/no/such/folder" in up.stderr
    )


def has_camera(node: Node) -> bool:
    """All others have been ready."""
    return node.processes("lan").get("camera", {}).get("state") == "ready"


def make_nodes(make_node: MakeNode, lan: Lan) -> list[Node]:
    return [
        make_node(deputy=f"node{i}", prefix=tuple(lan.at(i)), is_lan=True, port=FIRST_NODE_PORT - 100).start()
        for i in range(1, 5)
    ]


def test_four_nodes_make_what_one_makes(
    make_node: MakeNode, lan: Lan, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    nodes = make_nodes(make_node, lan)
    finished = nodes[0].command(*run_script(nodes[0], "lan.pmd", sequence, tmp_path / "out"))
    assert finished.returncode == 0, finished.stderr
    must_equal(tmp_path / "out", reference_run)
    assert [node.marked() for node in nodes] == [[], [], [], []]


def test_it_comes_back_when_deputies_die_and_a_cable_is_pulled(
    make_node: MakeNode, lan: Lan, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    nodes = make_nodes(make_node, lan)
    line = run_script(nodes[0], "lan.pmd", sequence, tmp_path / "out", "--set", "camera.pace=0.5")
    script = nodes[0].start_command(*line)
    try:
        wait_for(lambda: has_camera(nodes[0]), "the camera")
        nodes[2].kill()
        lan.set_link(2, "down")
        wait_for(lambda: not nodes[2].marked(), "the end of the orphans")
        nodes[2].start()
        wait_for(lambda: len(nodes[2].marked()) == 2, "the extractors of the node that died")
        lan.set_link(2, "up")
        must_succeed(script)
    finally:
        script.kill()
    must_equal(tmp_path / "out", reference_run)


def test_the_node_of_the_camera_dies_and_the_run_continues_when_it_is_back(
    make_node: MakeNode, lan: Lan, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    """What its tracker knew is on its disk; the extractors on the other nodes go on."""
    nodes = make_nodes(make_node, lan)
    line = run_script(nodes[1], "lan.pmd", sequence, tmp_path / "out", "--set", "camera.pace=0.5")
    script = nodes[1].start_command(*line)
    try:
        wait_for(lambda: has_camera(nodes[0]), "the camera")
        extractors = nodes[1].marked()
        nodes[0].kill()
        wait_for(lambda: not nodes[0].marked(), "the end of the orphans")
        nodes[0].start()
        wait_for(lambda: has_camera(nodes[0]), "the camera again")
        assert nodes[1].marked() == extractors
        assert "continues where it was when it was killed" in nodes[0].command("log", "tracker").stdout
        must_succeed(script)
    finally:
        script.kill()
    must_equal(tmp_path / "out", reference_run)
