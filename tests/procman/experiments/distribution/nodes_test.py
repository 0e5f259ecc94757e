"""The stack of a LAN as it is shipped, with as many extractors as an experiment wants, each in its control group."""

from pathlib import Path

import pytest

from tessera_cli.experiments.distribution.cpu_groups import CpuGroups
from tessera_cli.experiments.distribution.grid import HETEROGENEOUS, HOMOGENEOUS, SINGLE, Experiment
from tessera_cli.experiments.distribution.nodes import LIST, slow_commands, stack_list
from tessera_cli.supervision.command_list import SHIPPED_LIST, read_command_list
from tessera_cli.supervision.process_list import read_process_list


@pytest.mark.parametrize(
    "experiment, extractors, hosts",
    [
        (SINGLE, 3, ["node1"] * 3),
        (HOMOGENEOUS, 2, ["node2"] * 2),
        (HETEROGENEOUS, 1, ["node2"]),
        (HETEROGENEOUS, 8, ["node2"] * 4 + ["node3"] * 4),
    ],
)
def test_extractors_are_on_their_hosts(
    tmp_path: Path, experiment: Experiment, extractors: int, hosts: list[str]
) -> None:
    path = tmp_path / "stack.pmd"
    path.write_text(stack_list(LIST.read_text(), experiment, extractors))
    processes = read_process_list(path).processes.values()
    assert [each.host for each in processes if each.command == "extractor"] == hosts
    assert [each.instance for each in processes if each.command == "extractor"] == list(range(extractors))
    assert {each.host for each in processes if each.command != "extractor"} == {"node1"}


def test_each_extractor_joins_its_group_first(tmp_path: Path) -> None:
    path = tmp_path / "commands.pmd"
    path.write_text(slow_commands(SHIPPED_LIST.read_text(), CpuGroups(2, (tmp_path, 1))))
    commands = read_command_list(path)
    words = commands["extractor"].fill({"id": "1", "bin": "/b", "settings": "/s", "name": "extractor_1"})
    assert words[:3] == ["sh", "-c", 'echo $$ >"$0" && exec "$@"']
    assert words[3].startswith(str(tmp_path)) and words[3].endswith("/node1/cgroup.procs")
    assert words[4:] == ["/b/tessera-extractor", "--settings", "/s", "--name", "extractor_1", "--id", "1"]
    assert commands["tracker"] == read_command_list(SHIPPED_LIST)["tracker"]
