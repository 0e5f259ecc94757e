"""What others write on the bus and into logs reaches no terminal and no page raw: control characters become visible."""

import io
import os
import threading
import time
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console, RenderableType

from helpers.made_run import write_run
from helpers.nodes import MakeNode, Node
from helpers.page import Page
from helpers.stack import Tessera
from tessera_cli.cluster.keys import KeyRing, key_folder
from tessera_cli.constants import PORT_OFFSETS, PROCMAN_OUTPUT, PROCMAN_STATUS, STATUS
from tessera_cli.lcm_bus import Bus, bus_url
from tessera_cli.messages import (
    procman_list_t,
    procman_output_t,
    procman_process_t,
    procman_status_t,
    receive,
    stage_status_t,
)
from tessera_cli.report.html_report import write_report
from tessera_cli.runs.live_view import RunPanel
from tessera_cli.runs.run_folder import read_run
from tessera_cli.supervision.signatures import KEY_BYTES, SIGNATURE_BYTES, sign
from tessera_cli.supervision.stack_monitor import StackMonitor
from tessera_cli.supervision.watch import Watcher
from tessera_cli.text import visible, visible_lines, visible_values

# Clears the screen, renames the window, draws a link, reverses the reading order, pretends to be markup of rich or TeX.
HOSTILE = "a\x1b[2J\x1b]0;owned\x07\x9b31m\r\nb\u202ec [/] [bold]d[/bold] $^$ <script>e</script>"
SHOWN = r"a\x1b[2J\x1b]0;owned\x07\x9b31m\r\nb\u202ec [/] [bold]d[/bold] $^$ <script>e</script>"


def must_be_harmless(text: str) -> None:
    bad = {character for character in text if not character.isprintable() and character not in "\n\t"}
    assert not bad, repr(text)


def drawn(content: RenderableType) -> str:
    """As it stands in a terminal that is wide enough."""
    out = io.StringIO()
    Console(file=out, width=400, no_color=True).print(content)
    return out.getvalue()


def test_characters_that_do_something_become_visible() -> None:
    assert visible(HOSTILE) == SHOWN
    assert visible("Übersicht, 東京, 30 °") == "Übersicht, 東京, 30 °"
    assert visible(os.fsdecode(b"\xff")) == r"\udcff"
    assert visible_lines("one\r\n\ttwo\x1b\n") == "one\n\ttwo\\x1b\n"
    assert visible_values({"a\x1b": ["\x07", 1, None]}) == {r"a\x1b": [r"\x07", 1, None]}


def hostile_status() -> procman_status_t:
    process = procman_process_t()
    process.name = process.command = process.reason = HOSTILE
    process.state, process.pid = procman_process_t.READY, 1
    each = procman_list_t()
    each.name = each.run = each.channel_prefix = HOSTILE
    each.main_url, each.num_processes, each.processes = bus_url(8000), 1, [process]
    status = procman_status_t()
    status.deputy = status.host = status.last_refusal = HOSTILE
    status.nonce = bytes(16)
    status.num_kinds, status.kinds, status.num_refused = 1, [HOSTILE], [3]
    status.num_lists, status.lists = 1, [each]
    status.header.num_parts = 1
    status.key, status.signature = bytes(KEY_BYTES), bytes(SIGNATURE_BYTES)
    return status


def test_texts_of_messages_within_messages_too() -> None:
    received = receive(procman_status_t, hostile_status().encode())
    assert received is not None
    assert (received.host, received.kinds, received.lists[0].processes[0].reason) == (SHOWN, [SHOWN], SHOWN)


@pytest.fixture
def port(tessera: Tessera) -> Iterator[int]:
    """Of a bus on which somebody who is trusted says hostile things all the time."""
    port, is_over = tessera.next_port(), threading.Event()
    ring = KeyRing(key_folder())
    ring.make()
    key = ring.signing_key()
    bus = Bus(bus_url(port + PORT_OFFSETS["procman"]), "somebody")
    output = procman_output_t()
    output.deputy = output.process = output.text = HOSTILE

    def talk() -> None:
        while not is_over.wait(0.2):
            for channel, message in ((PROCMAN_STATUS, hostile_status()), (PROCMAN_OUTPUT, output)):
                message.header = bus.header(channel)
                bus.publish(channel, sign(message, key))

    thread = threading.Thread(target=talk)
    thread.start()
    yield port
    is_over.set()
    thread.join()


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_status(tessera: Tessera, port: int, options: tuple[str, ...]) -> None:
    out = tessera.command("status", "--port", port, *options).must_end_well().out
    must_be_harmless(out)
    assert (SHOWN if not options else SHOWN.replace("\\", "\\\\")) in out


def test_watch(port: int) -> None:
    watcher = Watcher(Namespace(port=port, lan=False))
    watcher._listen(1.0)
    panel = drawn(watcher._draw())
    must_be_harmless(panel)
    assert panel.count(SHOWN.split("\\n")[0]) >= 3  # deputy, process and output


@pytest.mark.parametrize("url, prefix", [("file:///tmp/x?mode=w", ""), (bus_url(8000), "a("), (bus_url(8000), ".*")])
def test_watch_listens_to_no_bus_that_is_none(tessera: Tessera, url: str, prefix: str) -> None:
    watcher, status = Watcher(Namespace(port=tessera.next_port(), lan=False)), hostile_status()
    status.lists[0].main_url, status.lists[0].channel_prefix = url, prefix
    watcher._sheriff._on_status(sign(status, KeyRing(key_folder()).signing_key()))
    watcher._follow_lists()
    assert watcher._monitors == {}


def test_log(make_node: MakeNode) -> None:
    node: Node = make_node('cmd "talker" { exec = "printf \'\\\\033[2Jwords\\\\n\'"; }').start()
    node.up('cmd "talker" { host = "node1"; ready = "started"; auto_respawn = "never"; }')
    assert node.command("log", "talker").stdout == "\\x1b[2Jwords\n"


def test_the_panel_of_a_run(tessera: Tessera) -> None:
    url = bus_url(tessera.next_port())
    monitor = StackMonitor(url, "", lambda _pid: True)
    status = stage_status_t()
    status.name, status.host, status.last_error = HOSTILE, os.uname().nodename, HOSTILE
    Bus(url, "somebody").publish(STATUS, status.encode())
    deadline = time.monotonic() + 10
    while not monitor.progress.stages and time.monotonic() < deadline:
        monitor.listen(0.05)
    panel = RunPanel("a run")
    panel._live.console = Console(file=io.StringIO(), width=400)
    text = drawn(panel._draw(monitor.progress))
    must_be_harmless(text)
    assert r"a\x1b[2J" in text


def test_the_report(tmp_path: Path) -> None:
    """Names of stages and their last words come from the bus, by way of files."""
    times = {name: {"median": 1.0, "p95": 2.0, "mean": 1.0, "max": 2.0} for name in ("tracker", HOSTILE)}
    folder = write_run(tmp_path / "run", stage_ms=times, cpu_s={HOSTILE: 1.0}, warnings=[HOSTILE], ended=HOSTILE)
    (folder / "stages" / "tracker.log").write_text(f"tessera-tracker: warning: {HOSTILE}\n")
    (folder / "settings.yaml").write_text('features: {"num_features": "\\e[2J"}\n')
    write_report([read_run(folder)], tmp_path / "report.html")
    source = (tmp_path / "report.html").read_text()
    must_be_harmless(source.replace("\u00a0", ""))
    assert "<script>e" not in source
    assert SHOWN in Page(tmp_path / "report.html").root.words()
