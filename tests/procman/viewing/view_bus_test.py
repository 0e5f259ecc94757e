"""What a view asks the stages of a running stack for."""

from collections.abc import Callable
from typing import Any

import pytest

from helpers.made_map import make_camera, make_change, make_delta, set_header, two_views
from tessera_cli.maps.map_follower import MAX_DELTAS
from tessera_cli.messages import decode, header_t, map_request_t, occupancy_request_t
from tessera_cli.messages import message_types as tessera
from tessera_cli.viewing import scene, view_bus


class FakeBus:
    """Passes on what the test sends, and keeps what the view sends."""

    url = "memq://"

    def __init__(self) -> None:
        self.handlers: dict[str, Callable[[bytes], None]] = {}
        self.sent: list[tuple[str, bytes]] = []

    def subscribe(self, channel: str, _type: Any, handler: Callable[[bytes], None]) -> None:
        self.handlers[channel] = handler

    def publish(self, channel: str, data: bytes) -> None:
        self.sent.append((channel, data))

    def header(self, _channel: str) -> Any:
        header = header_t()
        header.publisher = "viewer"
        return header


class FakeRun:
    def secret(self) -> None:
        return None


class FakeSink:
    def __init__(self) -> None:
        self.shown: list[scene.Shown] = []
        self.looks: list[scene.Look] = []

    def show(self, shown: scene.Shown) -> None:
        self.shown.append(shown)

    def arrange(self, look: scene.Look) -> None:
        self.looks.append(look)


def status_of(name: str) -> bytes:
    status = set_header(tessera.stage_status_t())
    status.name = name
    return bytes(status.encode())


def whole_occupancy(number: int) -> bytes:
    block = tessera.occupancy_block_t()
    block.states = bytes([block.OCCUPIED]) + bytes(1023)
    message = set_header(tessera.occupancy_t())
    message.number, message.resolution, message.is_whole = number, 0.1, True
    message.num_blocks, message.blocks = 1, [block]
    return bytes(message.encode())


def make_listener(bus: FakeBus, sink: FakeSink) -> Any:
    buses: Any = {"main": bus, "map": bus}
    return view_bus._Listener(buses, "B_", FakeRun(), sink)  # type: ignore[arg-type]


def test_the_view_is_arranged_once_for_the_size_of_the_image() -> None:
    bus, sink = FakeBus(), FakeSink()
    listener = make_listener(bus, sink)
    listener._arrange_once()
    assert sink.looks == [], "it is not known yet"
    calibration = set_header(tessera.calibration_t())
    calibration.camera = make_camera()
    bus.handlers["B_CALIBRATION"](bytes(calibration.encode()))
    listener._arrange_once()
    listener._arrange_once()
    assert [look.image_size for look in sink.looks] == [(calibration.camera.width, calibration.camera.height)]


def test_a_view_without_the_secret_of_the_run_says_that_it_shows_no_map(capsys: pytest.CaptureFixture[str]) -> None:
    bus, sink = FakeBus(), FakeSink()
    listener = make_listener(bus, sink)
    for asked in range(view_bus.MAX_MAP_ASKED + 3):
        listener._ask_for_map(10.0 * asked)
    assert [channel for channel, _ in bus.sent] == ["B_MAP_REQUEST"] * (view_bus.MAX_MAP_ASKED + 3)
    told = "".join(capsys.readouterr())
    assert told.count("the map is not shown: the stack on this bus answers its own members only") == 1


def test_deltas_of_one_answer_are_asked_for_once() -> None:
    bus, sink = FakeBus(), FakeSink()
    listener = make_listener(bus, sink)
    listener._ask_for_map(100.0)
    follower, num_answered = listener._scene.follower, MAX_DELTAS
    follower.on_delta(make_delta(0, two_views()))
    follower.on_delta(make_delta(num_answered + 3, make_change()))  # newer than the answer
    for number in range(1, num_answered):
        listener._ask_for_map(100.0 + 0.2 * number)
        follower.on_delta(make_delta(number, make_change()))
    listener._ask_for_map(100.0 + 0.2 * num_answered)
    requests = [decode(map_request_t, data) for _, data in bus.sent]
    assert [request.next_delta for request in requests if request] == [0, num_answered]


def test_a_late_view_asks_for_the_whole_occupancy_map_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    bus, sink = FakeBus(), FakeSink()
    listener = make_listener(bus, sink)
    bus.handlers["B_STATUS"](status_of("mapper"))
    listener._ask_for_occupancy(100.0)
    assert bus.sent == [], "no stage has one"
    bus.handlers["B_STATUS"](status_of("occupancy"))
    for now in (100.0, 101.0, 100.1 + view_bus.OCCUPANCY_ASK_S):
        listener._ask_for_occupancy(now)
    assert [channel for channel, _ in bus.sent] == ["B_OCCUPANCY_REQUEST"] * 2
    requests = [decode(occupancy_request_t, data) for _, data in bus.sent]
    assert [request.num_asked for request in requests if request] == [0, 1]
    bus.handlers["B_OCCUPANCY"](whole_occupancy(7))
    listener._ask_for_occupancy(200.0)
    assert len(bus.sent) == 2, "it is there"
    listener._show(listener._scene.map_shapes())
    assert [shown.path for shown in sink.shown if isinstance(shown, scene.Voxels)] == [f"{scene.VOXELS}/0_0_0"]
