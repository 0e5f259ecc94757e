"""Fixtures of the Python tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.nodes import FIRST_NODE_PORT, PORTS_PER_NODE, MakeNode, Node
from helpers.stack import NUM_FRAMES, Finished, Tessera
from helpers.synthetic_sequence import write_sequence
from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.distribution.lan import Lan, require_root


@pytest.fixture(autouse=True)
def own_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the test's own keys: the user's are neither used nor changed."""
    folder = tmp_path / "keys"
    monkeypatch.setenv("TESSERA_KEYS", str(folder))
    return folder


@pytest.fixture(scope="session")
def tessera(tmp_path_factory: pytest.TempPathFactory) -> Tessera:
    return Tessera(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A KITTI folder; its path has a space on purpose."""
    return write_sequence(tmp_path_factory.mktemp("made") / "room 1", NUM_FRAMES)


@pytest.fixture(scope="session")
def reference_run(tessera: Tessera, sequence: Path) -> Finished:
    """One extractor, whole images: what every other way of running must equal bit for bit."""
    return tessera.run(f"kitti:{sequence}", "--extractors", 1, "--tiles", "1x1").must_end_well()


_num_nodes = 0


@pytest.fixture
def make_node(tmp_path: Path, own_keys: Path) -> Iterator[MakeNode]:
    """Makes nodes, on ports of their own unless they are told, whose deputies end with the test."""
    nodes: list[Node] = []

    def make(
        commands: str = "",
        deputy: str = "node1",
        port: int | None = None,
        prefix: tuple[str, ...] = (),
        is_lan: bool = False,
    ) -> Node:
        global _num_nodes
        _num_nodes += 1
        folder = tmp_path / f"node {len(nodes)}"
        folder.mkdir()
        port = port or FIRST_NODE_PORT + PORTS_PER_NODE * (_num_nodes % 20)
        nodes.append(Node(folder, port, commands, deputy, prefix, is_lan))
        return nodes[-1]

    yield make
    for node in nodes:
        node.end_if_running()


@pytest.fixture
def lan() -> Iterator[Lan]:
    """Four nodes that share nothing but packets."""
    try:
        require_root("a test of nodes")
        with Lan([None] * 4) as made:
            yield made
    except (UserError, RunError) as error:
        pytest.skip(str(error))
