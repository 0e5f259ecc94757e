"""Several lists on the same deputies: each is started, replaced, ended and resumed alone."""

from helpers.nodes import FIRST_NODE_PORT, MakeNode, Node
from helpers.stack import wait_for
from tessera_cli.lcm_bus import bus_url
from tessera_cli.messages import pose_t, stage_status_t
from tessera_cli.supervision.list_monitor import ListMonitor
from tessera_cli.supervision.process_tree import marked

COMMANDS = """
cmd "sleeper"   { exec = "sleep 1000"; }
cmd "talker"    { exec = "sh -c 'echo I am ${name}; exec sleep 1000'"; }
"""


def listed(*names: str, more: str = "") -> str:
    return "".join(f'cmd "{name}" {{ host = "node1"; ready = "started"; {more} }}\n' for name in names)


def pids(node: Node, name: str) -> dict[str, int]:
    return {process: facts["pid"] for process, facts in node.processes(name).items()}


def up_two(node: Node) -> None:
    """Two robots whose processes have the same names."""
    for robot in ("robot_a", "robot_b"):
        up = node.up(listed("sleeper", "talker"), "--set", f"bus.channel_prefix={robot.upper()}_", name=robot)
        assert up.returncode == 0, up.stderr


def test_orders_for_one_list_leave_the_others_untouched(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    a, b = pids(node, "robot_a"), pids(node, "robot_b")
    assert set(a) == set(b) == {"sleeper", "talker"} and not set(a.values()) & set(b.values())
    up = node.up(listed("talker"), "--name", "robot_b", "--set", "bus.channel_prefix=ROBOT_B_", name="other file")
    assert up.returncode == 0, up.stderr
    wait_for(lambda: pids(node, "robot_b")["sleeper"] == 0, "the end of what robot_b no longer wants")
    assert pids(node, "robot_a") == a and pids(node, "robot_b")["talker"] == b["talker"]
    assert node.command("down", "robot_b").stdout == "tessera: all processes of robot_b are stopped\n"
    assert pids(node, "robot_a") == a and set(node.marked()) == set(a.values())
    assert node.command("down").returncode == 0
    assert node.marked() == []


def test_status_tells_the_lists_apart_and_with_which_channels(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    lists = node.status()["lists"]
    assert {name: each["channel_prefix"] for name, each in lists.items()} == {
        "robot_a": "ROBOT_A_",
        "robot_b": "ROBOT_B_",
    }
    shown = node.command("status").stdout
    assert "  robot_a: on udpm://" in shown and ", channels ROBOT_B_..." in shown


def test_a_name_that_two_lists_have_must_be_said_whole(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    vague = node.command("restart", "talker")
    assert vague.returncode == 2 and "robot_a/talker or robot_b/talker" in vague.stderr
    before = pids(node, "robot_b")
    assert node.command("restart", "robot_a/talker").returncode == 0
    assert node.processes("robot_a")["talker"]["starts"] == 2 and pids(node, "robot_b") == before
    wait_for(lambda: node.command("log", "robot_b/talker").stdout == "I am talker\n", "its words")
    assert (node.folder / "state" / "logs" / "robot_b" / "talker.log").is_file()


def test_each_list_is_resumed_by_a_new_deputy_but_for_what_was_ended(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    assert node.up(listed("sleeper"), name="pool").returncode == 0
    assert node.command("down", "robot_a").returncode == 0
    node.kill()
    wait_for(lambda: not node.marked(), "the end of the orphans")
    node.start()
    wait_for(lambda: len(node.marked()) == 3, "the processes of the last orders")
    folder = node.folder / "state"
    assert [len(marked(f"{folder}/{name}/")) for name in ("pool", "robot_a", "robot_b")] == [1, 0, 2]


def test_one_is_waited_for_in_its_own_list_only(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    assert node.up(listed("sleeper"), name="other").returncode == 0
    text = 'cmd "sleeper" { host = "node1"; auto_respawn = never; }' + listed("talker", more='depends = "sleeper";')
    up = node.up(text, "--timeout", "1", "--set", "bus.channel_prefix=X_")
    assert up.returncode == 1 and "waits for list/sleeper" in up.stderr


def test_a_bad_order_for_one_list_changes_nothing_of_any(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    before = node.status()["lists"]
    assert node.up(listed("sleeper", "reboot"), name="robot_b").returncode == 1
    assert {name: set(each["processes"]) for name, each in node.status()["lists"].items()} == {
        name: set(each["processes"]) for name, each in before.items()
    }
    assert len(node.marked()) == 4


def test_nodes_that_left_a_list_end_its_processes(make_node: MakeNode) -> None:
    one = make_node(COMMANDS).start()
    two = make_node(COMMANDS, deputy="node2", port=one.port).start()
    assert one.up('cmd "sleeper" { host = "node1, node2"; ready = "started"; }').returncode == 0
    assert len(two.marked()) == 1
    assert one.up('cmd "sleeper" { host = "node1"; count = 1; ready = "started"; }').returncode == 0
    wait_for(lambda: not two.marked(), "the end of what the list has no more there")
    assert len(one.marked()) == 1


def test_stages_of_one_name_on_one_bus_are_refused(make_node: MakeNode) -> None:
    node = make_node('cmd "tracker" { exec = "sleep 1000"; }').start()
    assert node.up(listed("tracker"), name="robot_a").returncode == 0
    up = node.up('cmd "tracker" { host = "node1"; }', name="robot_b")
    assert (
        up.returncode == 2
        and "robot_a has a 'tracker' on the same bus" in up.stderr
        and "bus.channel_prefix=ROBOT_B_" in up.stderr
    )
    assert node.processes("robot_b") == {}


def test_names_that_can_be_none_of_a_list_and_lists_that_are_not_there_are_told(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    for name in ("two words", "../x"):
        up = node.up(listed("sleeper"), "--name", name)
        assert up.returncode == 2 and "--name NAME" in up.stderr
    assert node.up(listed("sleeper"), name="robot_a").returncode == 0
    down = node.command("down", "robot_c")
    assert down.returncode == 2 and "no deputy has a list 'robot_c'; known: robot_a" in down.stderr


def test_a_list_that_ended_is_forgotten_with_the_next_order(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    up_two(node)
    assert node.command("down", "robot_a").returncode == 0
    assert node.processes("robot_a")["sleeper"]["state"] == "stopped"
    assert node.up(listed("sleeper"), name="pool").returncode == 0
    assert set(node.status()["lists"]) == {"robot_b", "pool"}


def test_counts_of_the_command_line_replace_those_of_the_list(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    text = listed("sleeper", more="count = 0;") + listed("talker", more="count = 2;")
    assert node.up(text, "--count", "talker=1", "--count", "sleeper=1", name="counted").returncode == 0
    assert set(pids(node, "counted")) == {"talker_0", "sleeper"}
    up = node.up(text, "--count", "walker=1", name="counted")
    assert up.returncode == 2 and 'no cmd "walker"' in up.stderr
    up = node.up(text, "--count", "talker=many", name="counted")
    assert up.returncode == 2 and "not CMD=NUMBER" in up.stderr


def test_who_begins_to_watch_late_knows_how_much_is_left() -> None:
    view = ListMonitor(bus_url(FIRST_NODE_PORT), "A_")
    camera = stage_status_t()
    camera.name, camera.value_names, camera.values, camera.num_values = "camera", ["num_frames"], [120.0], 1
    view.bus.publish("A_STATUS", camera.encode())
    for frame in range(100, 120):
        pose = pose_t()
        pose.header, pose.frame, pose.state = view.bus.header("A_POSE"), frame, pose_t.TRACKED
        pose.header.publisher = "tracker"
        view.bus.publish("A_POSE", pose.encode())

    def has_heard_all() -> bool:
        view.bus.handle_waiting()
        return view.progress.last_frame == 119

    wait_for(has_heard_all, "the poses")
    assert view.describe().startswith("frame 120 of 120, ") and "0:00 left" in view.describe()
