"""Process lists and command lists: what they mean, and that every fault is named with file, line and column."""

import signal
from pathlib import Path

import pytest

from helpers.stack import ROOT
from tessera_cli.errors import UserError
from tessera_cli.supervision.command_list import read_command_list
from tessera_cli.supervision.process_list import read_process_list


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "list.pmd"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["lan.pmd", "local.pmd"])
def test_shipped_lists_use_commands_of_the_shipped_command_list(name: str) -> None:
    shipped = read_process_list(ROOT / "procman" / name)
    commands = read_command_list(ROOT / "procman" / "commands.pmd")
    assert {process.command for process in shipped.processes.values()} <= set(commands)
    assert [name for name, command in commands.items() if command.held] == ["camera"]
    assert set(shipped.processes["camera"].depends) == set(shipped.processes) - {"camera"}
    assert "run" in shipped.scripts


def test_robots_have_no_extractors_and_their_pool_has_nothing_else() -> None:
    pool = read_process_list(ROOT / "procman" / "pool.pmd")
    robot = read_process_list(ROOT / "procman" / "local.pmd", {"extractor": 0})
    assert {process.command for process in pool.processes.values()} == {"extractor"}
    assert "extractor" not in {process.command for process in robot.processes.values()}
    assert pool.settings == ["extractor.robots=a_,b_"]


def test_the_lan_list_has_extractors_on_three_nodes_and_all_else_on_the_first() -> None:
    shipped = read_process_list(ROOT / "procman" / "lan.pmd")
    for process in shipped.processes.values():
        assert (process.host != "node1") == (process.command == "extractor")
    assert [shipped.processes[f"extractor_{i}"].instance for i in range(6)] == list(range(6))
    assert shipped.hosts == ["node1", "node2", "node3", "node4"]


def test_attributes_are_read(tmp_path: Path) -> None:
    found = read_process_list(
        write(
            tmp_path,
            """
        settings { features.num_features = 500; }
        cmd "a" { exec = "extractor"; host = "n1, n2"; count = 2; nice = -3; cpus = "0,2-3"; memory_limit_mb = 100.5;
                  auto_respawn = true; stop_signal = INT; stop_time_allowed = 0.5; ready = "started";
                  hang_timeout_s = 0; }
        cmd "b" { depends = "a"; }  # all four of them
    """,
        )
    )
    assert found.settings == ["features.num_features=500"]
    assert [(p.name, p.host, p.instance) for p in found.processes.values()] == [
        ("a_0", "n1", 0),
        ("a_1", "n1", 1),
        ("a_2", "n2", 2),
        ("a_3", "n2", 3),
        ("b", "", 0),
    ]
    options = found.processes["a_3"].options
    assert (options.nice, options.cpus, options.memory_limit_mb, options.auto_respawn) == (
        -3,
        (0, 2, 3),
        100.5,
        "always",
    )
    assert (options.stop_signal, options.stop_time_allowed, options.ready, options.hang_timeout_s) == (
        signal.SIGINT,
        0.5,
        "started",
        0,
    )
    assert found.processes["b"].depends == ("a_0", "a_1", "a_2", "a_3")


def test_scripts_name_processes(tmp_path: Path) -> None:
    script = read_process_list(
        write(
            tmp_path,
            """
        group "g" { cmd "a" { count = 2; } cmd "b" { } }
        script "s" { start group "g"; wait ms 500; wait cmd "a" status "running" timeout 7; run_script "t"; }
        script "t" { stop cmd "b"; }
    """,
        )
    ).scripts["s"]
    assert [step.action for step in script] == ["start", "wait", "wait", "run_script"]
    assert script[0].names == ("a_0", "a_1", "b") and script[1].seconds == 0.5
    assert (script[2].names, script[2].status, script[2].seconds) == (("a_0", "a_1"), "ready", 7)


@pytest.mark.parametrize(
    "text, line, column, words",
    [
        ('cmd "a" {\n  host = "n1"\n}', 3, 1, "expected ';'"),
        ('cmd "a" {\n  host "n1;\n}', 2, 8, "does not end on its line"),
        ('cmd "a" {\n  hosts = "n1";\n}', 2, 3, "no attribute 'hosts'"),
        ('cmd "a" {\n', 2, 1, "'}' is missing"),
        ('cmd "a" { } }', 1, 13, "expected a name"),
        ('cmd "a" { } ~', 1, 13, "is not allowed here"),
        ('cmd "a b" { }', 1, 1, "needs a name"),
        ("cmd { }", 1, 1, "needs a name"),
        ('cmd "a" { }\ncmd "a" { }', 2, 1, "taken"),
        ('cmd "a" { nice = 50; }', 1, 11, "from -20 to 19"),
        ('cmd "a" { nice = 5; nice = 6; }', 1, 21, "twice"),
        ('cmd "a" { cpus = "3-1"; }', 1, 11, "0,2-3"),
        ('cmd "a" { stop_signal = "NONE"; }', 1, 11, "SIGINT or 2"),
        ('cmd "a" { auto_respawn = perhaps; }', 1, 11, "one of always"),
        ('cmd "a" { exec = "rm -rf /"; }', 1, 11, "name of one command"),
        ('cmd "a" { exec = "rm x"; }', 1, 1, "name one command"),
        ('cmd "a" { environment = "LD_PRELOAD=x"; }', 1, 11, "deputy's own"),
        ('cmd "a" { count = -1; }', 1, 11, "from 0"),
        ('cmd "a" { count = 200; host = "a,b"; }', 1, 1, "more than 256"),
        ('cmd "a_1" { }\ncmd "a" { count = 2; }', 2, 1, 'be named "a_1"'),
        ('cmd "a" { depends = "b"; }', 1, 11, 'no cmd or group "b"'),
        ('cmd "a" { depends = "b"; }\ncmd "b" { depends = "a"; }', 1, 11, "none of them could ever start"),
        ('group "g" { host = "n"; }', 1, 13, "no attributes"),
        ('thing "g" { }', 1, 1, "no block 'thing'"),
        ('cmd "a" { }\nscript "s" { leap cmd "a"; }', 2, 14, "is no step"),
        ('cmd "a" { }\nscript "s" { start cmd "b"; }', 2, 24, 'no cmd or group "b"'),
        ('cmd "a" { }\nscript "s" { wait ms soon; }', 2, 22, "must be a number"),
        ('cmd "a" { }\nscript "s" { wait cmd "a" status "ready" within 5; }', 2, 42, "timeout SECONDS"),
        ('cmd "a" { }\nscript "s" { run_script "t"; }', 2, 14, 'no script "t"'),
        ('cmd "a" { }\nscript "s" { run_script "s"; }', 2, 14, "without end"),
        ('cmd "a" { }\nsettings { bus = 3; }', 2, 12, "no setting"),
    ],
)
def test_faults_are_named_with_their_place(tmp_path: Path, text: str, line: int, column: int, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(UserError) as caught:
        read_process_list(path)
    assert str(caught.value).startswith(f"{path}:{line}:{column}: ")
    assert words in str(caught.value)


@pytest.mark.parametrize("text", ["", "# nothing\n", 'script "s" { }'])
def test_a_list_without_processes_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(UserError, match="lists no process"):
        read_process_list(write(tmp_path, text))


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="can't be read"):
        read_process_list(tmp_path / "absent.pmd")
    (tmp_path / "bytes.pmd").write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match="not UTF-8"):
        read_process_list(tmp_path / "bytes.pmd")
    with pytest.raises(UserError, match="deeper than"):
        read_process_list(write(tmp_path, 'group "g" {' * 5000 + "}" * 5000))


def test_values_never_become_arguments_of_their_own(tmp_path: Path) -> None:
    command = read_command_list(
        write(
            tmp_path,
            'cmd "a" { exec = "run --name ${name} \'two words\'"; environment = "A=1 B=\'2 3\'"; folder = "/tmp"; }',
        )
    )["a"]
    assert command.fill({"name": "x --set y", "id": "0", "bin": "/b", "settings": "/s"}) == [
        "run",
        "--name",
        "x --set y",
        "two words",
    ]
    assert command.environment == {"A": "1", "B": "2 3"} and str(command.folder) == "/tmp"


@pytest.mark.parametrize(
    "text, place, words",
    [
        ('cmd "a" { }', "1:1", "no exec"),
        ('cmd "a" { exec = "run ${home}"; }', "1:11", "unknown ${home}"),
        ('cmd "a" { exec = "run \'x"; }', "1:11", "No closing quotation"),
        ('cmd "a" { exec = "run"; nice = 3; }', "1:25", "no attribute 'nice'"),
        ('cmd "a" { exec = "run"; held = "--two words"; }', "1:25", "must be one argument"),
        ('group "a" { }', "1:1", "only cmd"),
    ],
)
def test_faults_of_command_lists_are_named_with_their_place(tmp_path: Path, text: str, place: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(UserError) as caught:
        read_command_list(path)
    assert str(caught.value).startswith(f"{path}:{place}: ") and words in str(caught.value)


def test_counts_may_be_said_by_who_reads_the_list(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        'group "g" { cmd "a" { count = 2; } cmd "b" { count = 0; } } cmd "c" { depends = "g"; }'
        'script "s" { wait cmd "b" status "ready"; }',
    )
    assert list(read_process_list(path).processes) == ["a_0", "a_1", "c"], "none of b unless it is asked for"
    chosen = read_process_list(path, {"a": 1, "b": 1, "c": 2}).processes
    assert list(chosen) == ["a_0", "b", "c_0", "c_1"] and chosen["c_1"].depends == ("a_0", "b")
    with pytest.raises(UserError, match='no cmd "d"'):
        read_process_list(path, {"d": 1})
