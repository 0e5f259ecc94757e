"""What processes say: kept on the node within bounds, forwarded as whole lines within bounds."""

from pathlib import Path

from helpers.nodes import MakeNode
from helpers.orders import KEY
from tessera_cli.constants import MAX_OUTPUT_BYTES, TAIL_PIECE_BYTES
from tessera_cli.lcm_bus import Bus
from tessera_cli.messages import header_t, procman_output_t
from tessera_cli.supervision.log_file import ProcessLog
from tessera_cli.supervision.output_forwarder import OutputForwarder


class RecordingBus(Bus):
    """Keeps what is sent, and needs no network."""

    def __init__(self) -> None:
        self.sent: list[procman_output_t] = []

    def header(self, _channel: str) -> header_t:
        return header_t()

    def publish(self, _channel: str, data: bytes) -> None:
        self.sent.append(procman_output_t.decode(data))


def test_logs_are_rotated_and_the_oldest_go(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "a.log", max_bytes=100, num_old=2)
    for number in range(100):
        log.write(f"line {number:04d}\n".encode())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.log", "a.log.1", "a.log.2"]
    assert all(path.stat().st_size <= 110 for path in tmp_path.iterdir())
    assert log.tail(3) == "line 0097\nline 0098\nline 0099\n"
    assert log.tail(5).splitlines()[0] == "line 0095", "the tail reaches into the file before"


def test_a_log_goes_on_where_an_earlier_deputy_ended(tmp_path: Path) -> None:
    ProcessLog(tmp_path / "a.log").write(b"one\n")
    log = ProcessLog(tmp_path / "a.log")
    log.write(b"two\n\xff\n")
    assert log.tail(10) == "one\ntwo\n\N{REPLACEMENT CHARACTER}\n"
    assert (tmp_path / "a.log").read_bytes() == b"one\ntwo\n\xff\n", "bytes that are no text are kept unchanged"


def test_lines_are_forwarded_whole() -> None:
    bus = RecordingBus()
    forwarder = OutputForwarder(bus, "node1", KEY)
    forwarder.add("a", b"one\ntw")
    forwarder.flush(1.0)
    forwarder.add("a", b"o\n")
    forwarder.flush(2.0)
    assert [output.text for output in bus.sent] == ["one\n", "two\n"]


def test_a_chatterbox_is_cut_short_and_what_is_left_out_is_counted() -> None:
    bus = RecordingBus()
    forwarder = OutputForwarder(bus, "node1", KEY)
    forwarder.add("a", b"x" * 99 + b"\n" + (b"y" * 99 + b"\n") * 100)
    forwarder.flush(1.0)
    (output,) = bus.sent
    assert len(output.text) == MAX_OUTPUT_BYTES and output.num_omitted == 101 - MAX_OUTPUT_BYTES // 100


def test_a_tail_comes_in_pieces_with_an_end() -> None:
    bus = RecordingBus()
    text = "".join(f"{number}\n" for number in range(1000))
    OutputForwarder(bus, "node1", KEY).send_tail("a", "order", text)
    assert all(len(output.text) <= TAIL_PIECE_BYTES and output.order == "order" for output in bus.sent)
    assert "".join(output.text for output in bus.sent) == text and bus.sent[-1].text == ""


def test_one_that_closes_its_output_costs_the_deputy_nothing(make_node: MakeNode) -> None:
    import psutil

    node = make_node('cmd "quiet" { exec = "sh -c \'exec sleep 1000 >&- 2>&-\'"; }').start()
    assert node.up('cmd "quiet" { host = "node1"; ready = "started"; }').returncode == 0
    deputy = psutil.Process(node.process.pid)
    seconds = deputy.cpu_times().user + deputy.cpu_times().system
    node.status()  # listens for more than a second
    assert deputy.cpu_times().user + deputy.cpu_times().system - seconds < 0.5
