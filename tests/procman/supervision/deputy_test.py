"""Real deputies with processes that need no build: what they start, watch, start again and end, and whom they obey."""

import os
import random
import signal
import socket
import subprocess
import sys
from argparse import Namespace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import lcm
import pytest
from nacl.signing import SigningKey

from helpers.nodes import MakeNode
from helpers.orders import KEY, bad_order
from helpers.stack import environment, read_line, wait_for
from tessera_cli.cluster.keys import KeyRing, to_text
from tessera_cli.constants import LISTEN_S, LONGEST_TURN_S
from tessera_cli.errors import RunError
from tessera_cli.lcm_bus import bus_url
from tessera_cli.messages import procman_order_t, procman_status_t
from tessera_cli.supervision.orders import OrderVerifier
from tessera_cli.supervision.process_list import read_process_list
from tessera_cli.supervision.sheriff import Sheriff
from tessera_cli.supervision.signatures import sign

KEYS = (sys.executable, "-m", "tessera_cli", "keys")
COMMANDS = """
cmd "sleeper"   { exec = "sleep 1000"; }
cmd "family"    { exec = "sh -c 'setsid sleep 1001 & trap \\"\\" TERM; sleep 1002; wait'"; }
cmd "talker"    { exec = "sh -c 'echo I am ${name}; echo number ${id} >&2; exec sleep 1000'"; }
cmd "oneshot"   { exec = "true"; }
cmd "faulty"    { exec = "sh -c 'echo the disk is missing; exit 3'"; }
cmd "absent"    { exec = "/no/such/program"; }
cmd "glutton"   { exec = "python3 -c 'x = bytearray(200_000_000); import time; time.sleep(1000)'"; }
"""


def listed(*names: str, host: str = "node1", more: str = "") -> str:
    return "".join(f'cmd "{name}" {{ host = "{host}"; ready = "started"; {more} }}\n' for name in names)


def test_up_starts_status_shows_log_tells_and_down_ends(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up('cmd "talker" { host = "node1"; count = 2; ready = "started"; }' + listed("sleeper"))
    assert up.returncode == 0 and "3 processes on 1 nodes are ready" in up.stdout, up.stderr
    processes = node.processes()
    assert {name: process["state"] for name, process in processes.items()} == {
        "talker_0": "ready",
        "talker_1": "ready",
        "sleeper": "ready",
    }
    wait_for(lambda: "number" in node.command("log", "talker_1").stdout, "its words")
    assert node.command("log", "talker_1").stdout == "I am talker_1\nnumber 1\n"
    assert node.up('cmd "talker" { host = "node1"; count = 2; ready = "started"; }').returncode == 0
    wait_for(lambda: node.processes()["sleeper"]["state"] == "stopped", "the end of what is no longer wanted")
    assert node.processes()["talker_0"]["pid"] == processes["talker_0"]["pid"], "what is still wanted runs on"
    assert node.command("down").returncode == 0
    assert node.marked() == []


def test_what_was_killed_is_started_again_and_restart_does_so_on_purpose(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("sleeper")).returncode == 0
    first = node.processes()["sleeper"]["pid"]
    os.kill(first, signal.SIGKILL)
    wait_for(
        lambda: node.processes()["sleeper"]["state"] == "ready" and node.processes()["sleeper"]["starts"] == 2,
        "its return",
    )
    assert node.processes()["sleeper"]["reason"] == "was killed by SIGKILL"
    assert node.command("restart", "sleeper").returncode == 0
    assert node.processes()["sleeper"]["starts"] == 3
    assert node.command("restart", "nobody").returncode == 2


def test_a_process_has_its_nice_value_cpus_folder_and_environment(make_node: MakeNode, tmp_path: Path) -> None:
    words = "sh -c 'echo $COLOR $PWD; exec sleep 1000'"
    commands = f'cmd "placed" {{ exec = "{words}"; folder = "{tmp_path}"; environment = "COLOR=blue"; }}'
    node = make_node(commands).start()
    cpu = min(os.sched_getaffinity(0))
    assert node.up(listed("placed", more=f'nice = 7; cpus = "{cpu}";')).returncode == 0
    pid = node.processes()["placed"]["pid"]
    assert os.getpriority(os.PRIO_PROCESS, pid) == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 7)
    assert os.sched_getaffinity(pid) == {cpu}
    wait_for(lambda: node.command("log", "placed").stdout == f"blue {tmp_path}\n", "its words")


def test_a_whole_tree_ends_in_time_though_it_ignores_the_signal_and_made_sessions(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("family", more="stop_time_allowed = 0.5;")).returncode == 0
    wait_for(lambda: len(node.marked()) == 3, "the family")
    assert node.command("down").returncode == 0
    assert node.marked() == []


def test_a_killed_deputy_leaves_no_orphan_and_takes_its_orders_up_again(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("family", "sleeper")).returncode == 0
    wait_for(lambda: len(node.marked()) == 4, "the processes")
    node.kill()
    wait_for(lambda: not node.marked(), "the end of the orphans")
    node.start()
    wait_for(lambda: len(node.marked()) == 4, "the processes of the last order")
    assert node.end() == 0
    assert node.marked() == []


def test_a_failure_is_told_with_last_words(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up(listed("faulty", more="auto_respawn = never;"))
    assert up.returncode == 1 and "faulty on node1 is failed: ended with status 3: the disk is missing" in up.stderr
    assert node.command("status").returncode == 1
    up = node.up(listed("absent"))
    assert up.returncode == 1 and "can't be started" in up.stderr and "/no/such/program" in up.stderr


def test_one_that_always_dies_is_tried_with_longer_waits_and_then_given_up(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up(
        listed("faulty") + 'script "s" { start cmd "faulty"; wait cmd "faulty" status "finished" timeout 30; }',
        "--script",
        "s",
    )
    assert up.returncode == 1 and "ended 7 times in a row" in up.stderr and "list.pmd:2" in up.stderr


def test_more_memory_than_allowed_ends_it(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    node.up(listed("glutton", more="memory_limit_mb = 100; auto_respawn = never;"))
    wait_for(lambda: node.processes()["glutton"]["state"] == "failed", "its end")
    assert "more than its limit of 100" in node.processes()["glutton"]["reason"]


def test_one_waits_for_another_and_says_for_whom(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    text = (
        listed("oneshot")
        + 'cmd "sleeper" { host = "node1"; ready_timeout_s = 1; auto_respawn = never; }'
        + listed("talker", more='depends = "sleeper";')
    )
    up = node.up(
        text + 'script "s" { start cmd "talker"; wait cmd "talker" status "ready" timeout 1; }', "--script", "s"
    )
    assert up.returncode == 1 and "talker on node1 is waiting: waits for list/sleeper" in up.stderr
    up = node.up(
        text + 'script "s" { start cmd "sleeper"; wait cmd "sleeper" status "ready" timeout 20; }', "--script", "s"
    )
    assert up.returncode == 1 and "was not ready within 1 s" in up.stderr
    assert (
        node.up(
            text + 'script "s" { start cmd "oneshot"; wait cmd "oneshot" status "finished"; }', "--script", "s"
        ).returncode
        == 0
    )


def test_readiness_is_awaited_across_nodes(make_node: MakeNode) -> None:
    one = make_node(COMMANDS).start()
    two = make_node(COMMANDS, deputy="node2", port=one.port).start()
    up = one.up(listed("sleeper", host="node2") + listed("talker", more='depends = "sleeper";'))
    assert up.returncode == 0 and "2 processes on 2 nodes" in up.stdout, up.stderr
    assert list(one.processes()) == ["talker"] and list(two.processes()) == ["sleeper"]
    assert one.command("down").returncode == 0
    assert one.marked() + two.marked() == []


def test_only_commands_of_the_own_list_are_executed(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up(listed("reboot"))
    assert up.returncode == 1 and "'reboot' is not in this deputy's command list, which has: sleeper, " in up.stderr
    assert node.processes() == {}


def test_bad_settings_are_refused_before_anything_starts(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up("settings { tracker.wings = 2; }" + listed("sleeper"))
    assert up.returncode == 2 and "wings" in up.stderr
    assert node.processes() == {}


def test_a_setting_with_a_nul_is_refused_and_the_deputy_lives_on(make_node: MakeNode) -> None:
    """Signed by a key that the deputy trusts: the command itself lets no such setting through."""
    node = make_node(COMMANDS).start()
    sheriff = Sheriff(Namespace(port=node.port, lan=False))
    sheriff.discover_deputies()
    list_path = node.folder / "list.pmd"
    list_path.write_text(listed("sleeper"))
    processes = list(read_process_list(list_path, {}).processes.values())
    with pytest.raises(RunError, match=r"node1 refuses: the setting camera.source=a\\x00b holds a control character"):
        sheriff.run("node1", "list", processes, ["camera.source=a\0b"], "a session")
    assert node.processes() == {}


def test_time_in_which_a_sheriff_was_suspended_is_no_silence_of_deputies(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    moments = iter([100.0, 100.0 + LISTEN_S, 200.0, 3800.0])  # before and after each listening
    sheriff = Sheriff(Namespace(port=make_node(COMMANDS).port, lan=False))
    monkeypatch.setattr("tessera_cli.supervision.sheriff.listen", lambda *_: None)
    monkeypatch.setattr("tessera_cli.supervision.sheriff.time", SimpleNamespace(monotonic=lambda: next(moments)))
    sheriff.listen(LISTEN_S)
    assert sheriff.listened_s == pytest.approx(LISTEN_S)
    sheriff.listen(LISTEN_S)
    assert sheriff.listened_s == pytest.approx(2 * LISTEN_S + LONGEST_TURN_S)


@pytest.mark.parametrize(
    "settings, words",
    [
        ("recorder.path = /tmp/elsewhere/x.lcmlog; ", "not in the run's folder"),
        ("recorder.path = ${out}/../x.lcmlog; ", "not in the run's folder"),
        ("evaluator.save_map = ${link}/authorized_keys; ", "not in the run's folder"),
        ("map_writer.path = map.ply; ", "not in the run's folder"),
        ("evaluator.out_dir = /tmp/.config/autostart; ", "must not be hidden"),
        ("bus.work_url = file:///tmp/x?mode=w; ", "must be udpm://"),
    ],
)
def test_an_order_writes_nowhere_but_in_the_runs_folder(make_node: MakeNode, settings: str, words: str) -> None:
    node = make_node(COMMANDS).start()
    out = node.folder / "out"
    out.mkdir()
    (out / "link").symlink_to(Path.home())
    settings = settings.replace("${out}", str(out)).replace("${link}", str(out / "link"))
    options = [word for each in settings.split(";") if each.strip() for word in ("--set", each.replace(" ", ""))]
    up = node.up(listed("sleeper"), *(() if "out_dir" in settings else ("--out", out)), *options)
    assert up.returncode == 1 and words in up.stderr, up.stderr
    assert node.processes() == {}


def test_the_deputys_own_list_allows_more_folders(make_node: MakeNode, tmp_path: Path) -> None:
    allowed = tmp_path / "recordings"
    node = make_node(COMMANDS + f'cmd "writer" {{ exec = "sleep 1"; writes = "{allowed}"; }}').start()
    inside = node.up(listed("sleeper"), "--out", tmp_path / "out", "--set", f"recorder.path={allowed}/x.lcmlog")
    assert inside.returncode == 0, inside.stderr
    beside = node.up(listed("sleeper"), "--out", tmp_path / "out", "--set", f"recorder.path={allowed}2/x.lcmlog")
    assert beside.returncode == 1 and f'writes = "{allowed}2"' in beside.stderr


def test_a_host_without_a_deputy_and_a_second_deputy_with_one_id_are_told(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up = node.up(listed("sleeper", host="node7"))
    assert up.returncode == 2 and "no deputy answers for node7; known: node1" in up.stderr
    finished = node.command("deputy", "--id", "node1", "--folder", node.folder / "other")
    assert finished.returncode == 2 and "a deputy with the id node1 already runs on" in finished.stderr
    same = node.command("deputy", "--id", "node1", "--folder", node.folder / "state")
    assert same.returncode == 2 and "runs on this machine already" in same.stderr


def test_without_a_deputy_commands_say_so(make_node: MakeNode) -> None:
    node = make_node(COMMANDS)
    for command in ("down", "status"):
        finished = node.command(command)
        assert finished.returncode == 1 and "no deputy answers" in finished.stderr


def test_what_runs_needs_no_sheriff_and_another_one_finds_it(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    (node.folder / "list.pmd").write_text(listed("sleeper") + 'script "s" { start cmd "sleeper"; wait ms 100000; }')
    script = subprocess.Popen(
        node.line("up", node.folder / "list.pmd", "--script", "s"), env=environment(), stdin=subprocess.DEVNULL
    )
    wait_for(node.marked, "its process")
    pids = node.marked()
    script.kill()
    script.wait()
    assert node.up(listed("sleeper")).returncode == 0
    assert node.marked() == pids == [node.processes()["sleeper"]["pid"]]


def test_watch_prints_lines_without_a_terminal(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("sleeper")).returncode == 0
    watch = node.start_command("watch")
    try:
        assert read_line(watch) == "no pose yet\n"
        assert read_line(watch).startswith("node1 (")
        assert read_line(watch).startswith("  list: on udpm://")
        assert read_line(watch).split()[:2] == ["sleeper", "ready"]
        watch.terminate()
        assert watch.wait(30) == 0
    finally:
        watch.kill()


def test_watch_says_where_no_deputy_is(make_node: MakeNode) -> None:
    watch = make_node(COMMANDS).start_command("watch")
    try:
        assert read_line(watch).startswith("no deputy answers: ")
    finally:
        watch.kill()
        watch.wait()


def test_a_busy_port_is_told(make_node: MakeNode) -> None:
    node = make_node(COMMANDS)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("", node.port + 3))
        for command in ("deputy", "status"):
            finished = node.command(command)
            assert (
                finished.returncode == 1
                and f"{node.port + 3}" in finished.stderr
                and "hold its port" in finished.stderr
            )
            assert "Traceback" not in finished.stderr


def test_who_is_not_trusted_is_not_obeyed_and_told_why(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    node = make_node(COMMANDS).start()
    monkeypatch.setenv("TESSERA_KEYS", str(tmp_path / "a stranger"))
    up = node.up(listed("sleeper"))
    assert up.returncode == 2 and "does not trust" in up.stderr and "keys trust node1 " in up.stderr
    trust = up.stderr.partition("tessera keys trust ")[2].rstrip(".\n").split()
    assert subprocess.run([*KEYS, "trust", *trust], env=environment()).returncode == 0
    up = node.up(listed("sleeper"))
    assert up.returncode == 1 and "unknown key" in up.stderr
    assert node.processes() == {} and node.status()["orders_obeyed"] == 0


def hear_status(bus: lcm.LCM, asked: list[procman_status_t]) -> procman_status_t:
    del asked[:]
    while not asked:
        assert bus.handle_timeout(5000) > 0
    return asked[-1]


def test_of_a_thousand_bad_orders_on_the_bus_none_is_obeyed_and_all_are_counted(
    make_node: MakeNode, own_keys: Path
) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("sleeper")).returncode == 0
    bus, heard = lcm.LCM(bus_url(node.port + 3)), list[procman_status_t]()
    bus.subscribe("PROCMAN_STATUS", lambda _channel, data: heard.append(procman_status_t.decode(data)))
    before = hear_status(bus, heard)
    # So that all kinds except strangers' pass the first check.
    KeyRing(own_keys).trust("tests", to_text(KEY.verify_key.encode()))
    verifier = OrderVerifier("node1", list)
    verifier.nonce = before.nonce
    replay = (node.folder / "state" / "orders" / "list").read_bytes()
    randomness = random.Random(8)

    def has_refused_more_than(number: int) -> bool:
        return sum(hear_status(bus, heard).num_refused) - sum(before.num_refused) > number

    for number in range(1000):
        bus.publish("PROCMAN_ORDER", bad_order(verifier, [replay], randomness))
        if number % 100 == 99:  # the kernel's buffer holds 135 or more of them while the deputy can't run
            wait_for(partial(has_refused_more_than, number), "the count")
    status = heard[-1]
    assert sum(status.num_refused) - sum(before.num_refused) == 1000
    assert status.num_obeyed == before.num_obeyed and [process.pid for process in status.lists[0].processes] == [
        process.pid for process in before.lists[0].processes
    ]


def test_a_revoked_key_is_obeyed_no_longer(make_node: MakeNode, own_keys: Path) -> None:
    node = make_node(COMMANDS).start()
    bus, heard = lcm.LCM(bus_url(node.port + 3)), list[procman_status_t]()
    bus.subscribe("PROCMAN_STATUS", lambda _channel, data: heard.append(procman_status_t.decode(data)))
    ring, key = KeyRing(own_keys), SigningKey(bytes(range(32)))
    status = hear_status(bus, heard)

    def order() -> bytes:
        order = procman_order_t()
        order.deputy, order.nonce, order.number, order.action = (
            "node1",
            status.nonce,
            status.last_number + 1,
            procman_order_t.RUN,
        )
        return sign(order, key)

    ring.trust("base", to_text(key.verify_key.encode()))
    bus.publish("PROCMAN_ORDER", order())
    wait_for(lambda: hear_status(bus, heard).num_obeyed == 1, "the order of a trusted key")
    status = heard[-1]
    ring.revoke("base")
    bus.publish("PROCMAN_ORDER", order())
    wait_for(lambda: "unknown key" in hear_status(bus, heard).kinds, "the refusal")
    assert heard[-1].num_obeyed == 1
