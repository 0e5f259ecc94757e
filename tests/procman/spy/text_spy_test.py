"""What the text of `tessera spy` tells of the messages on a bus."""

from rich.console import Console

from helpers.made_map import make_delta, make_keypoints, set_header, two_views
from tessera_cli.messages import message_types as tessera
from tessera_cli.spy.message_tree import tree_of
from tessera_cli.spy.text_spy import draw, plain_lines
from tessera_cli.spy.traffic import Traffic


def pose(sequence: int, epoch_us: int = 1) -> bytes:
    message = set_header(tessera.pose_t())
    message.header.publisher, message.header.sequence, message.header.epoch_us = "tracker", sequence, epoch_us
    return message.encode()


def traffic_of(*sequences: int) -> Traffic:
    traffic = Traffic()
    for index, sequence in enumerate(sequences):
        traffic.add("POSE", pose(sequence), 0.1 * index)
    return traffic


def test_rates_are_those_of_the_last_seconds() -> None:
    (channel,) = traffic_of(*range(30)).channels()
    messages, num_bytes = channel.rates(3.0)
    assert messages == 10
    assert num_bytes == 10 * len(pose(0))
    assert channel.rates(60.0) == (0, 0)
    assert channel.num_messages == 30


def test_missing_numbers_are_gaps_until_they_come() -> None:
    traffic = traffic_of(7, 8, 11, 12)
    (channel,) = traffic.channels()
    assert channel.num_missing == 2, "what was sent before the first is not missed"
    traffic.add("POSE", pose(9), 1.0)
    assert (channel.num_missing, channel.num_late) == (1, 1)
    traffic.add("POSE", pose(9), 1.0)
    assert (channel.num_missing, channel.num_late) == (1, 1), "it came twice"
    traffic.add("POSE", pose(0, epoch_us=2), 1.0)
    assert channel.num_missing == 1, "a publisher that starts again begins a new stream"


def test_a_large_gap_is_counted_without_remembering_it() -> None:
    (channel,) = traffic_of(0, 10**9).channels()
    assert channel.num_missing == 10**9 - 1


def test_a_message_is_a_tree_of_its_fields() -> None:
    features = tessera.features_t()
    features.keypoints = make_keypoints(3, [(float(i), 2.5) for i in range(20)])
    lines = tree_of(features.encode())
    assert "header" in lines
    assert "  frame: 3" in lines
    assert "    fx: 500" in lines
    assert "  x: 20 numbers, 0 .. 19: 0 1 2 3 4 5 6 7 ..." in lines
    assert "  descriptors: 20 items" in lines
    assert "    ... 17 more" in lines


def test_lists_of_structs_and_of_nothing() -> None:
    delta = tessera.map_delta_t()
    delta.change = two_views()
    lines = tree_of(delta.encode())
    assert "  new_keyframes: 2 items" in lines
    assert "  removed_landmarks: none" in lines
    assert "      landmark: 3" in lines
    assert make_delta(0, two_views()) is not None


def test_other_bytes_are_told_as_such() -> None:
    assert tree_of(b"12345678 what is this") == ["21 bytes that are no message of this version"]
    traffic = Traffic()
    traffic.add("OTHER", b"123", 0.0)
    assert plain_lines(traffic, 0.0, "OTHER")[1].split()[:2] == ["OTHER", "?"]


def test_everything_fits_80_columns_and_the_height() -> None:
    traffic = traffic_of(*range(30))
    traffic.add("A_CHANNEL_WITH_A_VERY_LONG_NAME_OF_A_ROBOT_FEATURES", pose(0), 0.0)
    console = Console(width=80, height=24, force_terminal=False)
    with console.capture() as capture:
        console.print(draw(traffic, 3.0, "POSE", 24, "udpm://239.255.76.67:7667?ttl=0"))
    lines = capture.get().rstrip("\n").split("\n")
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 24
    assert any("POSE from tracker" in line for line in lines)
    assert max(map(len, plain_lines(traffic_of(1, 2), 0.2, None))) <= 80
