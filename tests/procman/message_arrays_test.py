"""Messages that are decoded as arrays say what the generated decoders say."""

import numpy as np
import pytest

from helpers.made_map import make_delta, set_header, two_views
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import message_types as tessera


def test_arrays_hold_what_was_sent() -> None:
    change = make_delta(7, two_views()).change
    assert [keyframe.keyframe for keyframe in change.new_keyframes] == [0, 1]
    assert change.new_keyframes[1].world_from_camera.translation.tolist() == [0.5, 0, 0]
    assert change.new_keyframes[0].keypoints.x.tolist() == [320, 10]
    assert change.landmarks["landmark"].tolist() == [3, 5]
    assert change.landmarks["position_in_world"][1].tolist() == [1, 0, 5]
    assert change.landmarks["descriptor"]["bits"].shape == (2, 32)
    assert change.new_observations["keypoint"].tolist() == [0, 0, 1]
    assert change.removed_landmarks.shape == (0,)


def test_strings_and_numbers_are_those_of_the_generated_decoder() -> None:
    status = set_header(tessera.stage_status_t())
    status.name, status.pid, status.cpu_percent, status.state = "träcker", 17, 12.5, tessera.stage_status_t.RUNNING
    status.num_values, status.value_names, status.values = 2, ["a", ""], [1.5, -2.0]
    data = status.encode()
    as_generated, as_arrays = tessera.stage_status_t.decode(data), decode_arrays(tessera.stage_status_t, data)
    assert as_arrays is not None
    for name in ("name", "pid", "cpu_percent", "state", "value_names", "last_error"):
        assert getattr(as_arrays, name) == getattr(as_generated, name), name
    assert as_arrays.values.tolist() == [1.5, -2.0]
    assert as_arrays.header.publisher == "mapper"


@pytest.mark.parametrize("length", [0, 4, 8, 40, -1])
def test_bytes_that_are_cut_off_are_no_message(length: int) -> None:
    delta = tessera.map_delta_t()
    delta.change = two_views()
    assert decode_arrays(tessera.map_delta_t, delta.encode()[:length]) is None


def test_other_types_and_longer_messages_are_refused() -> None:
    data = tessera.map_request_t().encode()
    assert decode_arrays(tessera.map_request_t, data) is not None
    assert decode_arrays(tessera.map_request_t, data + b"\0") is None
    assert decode_arrays(tessera.map_delta_t, data) is None


def test_arrays_of_negative_length_are_refused() -> None:
    ack = tessera.tile_ack_t()
    ack.num_tiles, ack.tiles = 1, [3]
    data = bytearray(ack.encode())
    after_count = 4 + 1 + 4  # a tile, wants_all, num_levels
    data[-after_count - 4 : -after_count] = np.array(-1, ">i4").tobytes()
    assert decode_arrays(tessera.tile_ack_t, bytes(data)) is None
