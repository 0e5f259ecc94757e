"""What `tessera up` makes of a process list."""

from pathlib import Path

from tessera_cli.files import PROCMAN
from tessera_cli.runs.up import has_map_on_several_hosts
from tessera_cli.supervision.process_list import read_process_list


def test_extractors_alone_are_on_other_hosts_in_the_shipped_list() -> None:
    assert not has_map_on_several_hosts(read_process_list(PROCMAN / "lan.pmd"))


def test_a_tracker_on_another_host_exchanges_the_map_over_the_network(tmp_path: Path) -> None:
    text = (PROCMAN / "lan.pmd").read_text()
    path = tmp_path / "spread.pmd"
    path.write_text(text.replace('cmd "tracker" { host = "node1"', 'cmd "tracker" { host = "node2"'))
    assert path.read_text() != text
    assert has_map_on_several_hosts(read_process_list(path))
