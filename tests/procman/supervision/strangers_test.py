"""Strangers on the bus of the deputies: what they say of deputies is not believed, and locks nobody out."""

import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import lcm
import psutil
import pytest
from nacl.signing import SigningKey

from helpers.nodes import MakeNode
from helpers.orders import KEY, OTHER_KEY, make_order, make_verifier
from tessera_cli.lcm_bus import bus_url
from tessera_cli.messages import procman_list_t, procman_process_t, procman_status_t
from tessera_cli.supervision.deputy_words import DeputyWords
from tessera_cli.supervision.orders import MAX_NUMBER_STEP
from tessera_cli.supervision.signatures import sign
from tessera_cli.supervision.state_folder import StateFolder

COMMANDS = 'cmd "sleeper" { exec = "sleep 1000"; }\n'
LIST = 'cmd "sleeper" { host = "node1"; ready = "started"; }\n'
MAX_GROWTH_BYTES = 10_000_000


def make_status(deputy: str = "node1", sequence: int = 0, epoch_us: int = 1000) -> procman_status_t:
    status = procman_status_t()
    status.header.publisher, status.header.epoch_us, status.header.sequence = f"deputy_{deputy}", epoch_us, sequence
    status.header.num_parts = 1
    status.deputy, status.host, status.nonce = deputy, "elsewhere", bytes(16)
    return status


def make_words() -> DeputyWords:
    return DeputyWords(lambda: {KEY.verify_key.encode()})


def test_a_status_counts_that_a_trusted_key_signed() -> None:
    words = make_words()
    status = words.accept(procman_status_t, sign(make_status(), KEY))
    assert status is not None and status.host == "elsewhere"
    assert words.accept(procman_status_t, sign(make_status(sequence=1), OTHER_KEY)) is None
    unsigned = make_status(sequence=1)
    unsigned.header.tag, unsigned.key, unsigned.signature = bytes(16), KEY.verify_key.encode(), bytes(64)
    assert words.accept(procman_status_t, unsigned.encode()) is None
    assert words.refused == {"unknown key": 1, "unsigned": 1}
    assert words.unknown == {"node1": OTHER_KEY.verify_key.encode()}, "who it is can be told"


def test_each_is_heard_once_and_in_order() -> None:
    words = make_words()
    data = [sign(make_status(sequence=number), KEY) for number in range(3)]
    assert words.accept(procman_status_t, data[1]) is not None
    assert [words.accept(procman_status_t, each) is not None for each in data] == [False, False, True]
    assert words.accept(procman_status_t, sign(make_status(epoch_us=2000), KEY)) is not None, "a newer life"
    assert words.accept(procman_status_t, data[2]) is None, "an older one"
    assert words.refused == {"replayed": 3}


def test_an_order_is_no_status_though_its_key_is_trusted() -> None:
    words = make_words()
    assert words.accept(procman_status_t, sign(make_order(make_verifier()), KEY)) is None
    assert words.refused == {"malformed": 1}


def test_every_single_changed_bit_of_a_status_is_noticed() -> None:
    words, data = make_words(), sign(make_status(), KEY)
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 1 << position % 8
        assert words.accept(procman_status_t, bytes(changed)) is None
    assert words.accept(procman_status_t, data) is not None


def test_a_number_that_leaves_no_room_for_others_is_implausible() -> None:
    verifier = make_verifier()
    for number in (2**63 - 1, 2**62, MAX_NUMBER_STEP + 1):
        assert verifier.accept(sign(make_order(verifier, number), KEY)) is None
    assert verifier.refused == {"implausible": 3}
    assert verifier.accept(sign(make_order(verifier, 1), KEY)) is not None


def test_a_deputys_lives_are_in_order_also_when_the_clock_is_set_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = StateFolder(tmp_path, "node1")
    first, earlier = folder.begin_epoch()
    assert earlier == set()
    monkeypatch.setattr(time, "time", lambda: 1.0)
    second, earlier = folder.begin_epoch()
    assert second == first + 1 and earlier == {first}
    (tmp_path / "epochs").write_text("no number\n-5\n" + 100 * "9" + "\n")
    assert folder.begin_epoch() == (1_000_000, set())


def boast(status: procman_status_t) -> None:
    """It has obeyed the last order that can be numbered, and runs everything."""
    status.last_number = 2**63 - 1
    process = procman_process_t()
    process.name, process.state, process.pid = "sleeper", procman_process_t.FINISHED, 1
    each = procman_list_t()
    each.name, each.processes, each.num_processes = "list", [process], 1
    status.lists, status.num_lists = [each], 1


def almost(status: procman_status_t) -> None:
    status.last_number = 2**63 - 2


def forge_names(status: procman_status_t) -> None:
    boast(status)
    status.deputy = f"node{random.randrange(10**9)}"
    status.lists[0].processes[0].name = f"sleeper_{random.randrange(10**9)}"


@contextmanager
def forging(port: int, change: Callable[[procman_status_t], None]) -> Iterator[None]:
    """Says all the time what no deputy said: unsigned, signed by a stranger, and with somebody else's key."""
    ends = threading.Event()
    stranger = SigningKey.generate()

    def forge() -> None:
        bus = lcm.LCM(bus_url(port))
        number = 0
        while not ends.wait(0.002):
            number += 1
            status = make_status(sequence=number, epoch_us=4 * 10**15)
            change(status)
            data = sign(status, stranger)
            for forged in (data, data[:-64] + bytes(64), data[:-96] + KEY.verify_key.encode() + data[-64:]):
                bus.publish("PROCMAN_STATUS", forged)

    thread = threading.Thread(target=forge)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


@pytest.mark.parametrize("change", [boast, almost, forge_names])
def test_forged_words_of_deputies_change_nothing(
    make_node: MakeNode, change: Callable[[procman_status_t], None]
) -> None:
    node = make_node(COMMANDS)
    with forging(node.port + 3, change):
        node.start()
        memory = psutil.Process(node.process.pid).memory_info().rss
        up = node.up(LIST)
        assert up.returncode == 0, up.stderr
        processes = node.processes()
        assert processes["sleeper"]["state"] == "ready" and processes["sleeper"]["pid"] > 1
        assert node.command("restart", "sleeper").returncode == 0
        assert node.processes()["sleeper"]["starts"] == 2
        assert node.command("down").returncode == 0
        assert psutil.Process(node.process.pid).memory_info().rss - memory < MAX_GROWTH_BYTES
    assert node.marked() == []


def test_who_repeats_what_a_deputy_said_before_its_restart_keeps_it_from_nothing(make_node: MakeNode) -> None:
    node = make_node(COMMANDS).start()
    heard: list[bytes] = []
    bus = lcm.LCM(bus_url(node.port + 3))
    bus.subscribe("PROCMAN_STATUS", lambda _channel, data: heard.append(data))
    while len(heard) < 2:
        assert bus.handle_timeout(5000) > 0
    assert node.end() == 0
    ends = threading.Event()

    def repeat() -> None:
        while not ends.wait(0.01):
            for data in heard[:2]:
                bus.publish("PROCMAN_STATUS", data)

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        node.start()
        assert node.process.poll() is None
        up = node.up(LIST)
        assert up.returncode == 0, up.stderr
    finally:
        ends.set()
        thread.join()
