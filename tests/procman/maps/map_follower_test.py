"""A listener follows the map from any moment on, whatever is lost on the way."""

from helpers.made_map import make_change, make_delta, make_landmark, make_page, two_views
from tessera_cli.maps.map_follower import MAX_DELTAS, MAX_PAGES, MAX_WAITING, MapFollower, Request


def landmark_delta(number: int, part: int = 0, num_parts: int = 1) -> object:
    """Brings landmark 100 + 10 * number + part."""
    landmark = make_landmark(100 + 10 * number + part, (0.0, 0.0, 1.0))
    return make_delta(number, make_change(landmarks=[landmark]), part, num_parts)


def ids_of(follower: MapFollower) -> list[int]:
    return follower.replica.landmark_ids().tolist()


def test_deltas_from_the_beginning() -> None:
    follower = MapFollower()
    assert follower.on_delta(landmark_delta(0))
    assert follower.on_delta(landmark_delta(1))
    assert not follower.on_delta(landmark_delta(1)), "it came again"
    assert ids_of(follower) == [100, 110]
    assert follower.request() is None


def test_a_delta_in_parts_counts_when_all_are_there() -> None:
    follower = MapFollower()
    assert not follower.on_delta(landmark_delta(0, part=1, num_parts=2))
    assert follower.on_delta(landmark_delta(0, part=0, num_parts=2))
    assert ids_of(follower) == [100, 101]


def test_what_follows_a_gap_waits_for_it() -> None:
    follower = MapFollower()
    follower.on_delta(landmark_delta(0))
    assert not follower.on_delta(landmark_delta(2))
    assert follower.request() == Request(next_delta=1)
    assert follower.on_delta(landmark_delta(1))
    assert ids_of(follower) == [100, 110, 120]
    assert follower.request() is None


def test_a_gap_is_closed_however_much_came_behind_it() -> None:
    follower = MapFollower()
    last = MAX_WAITING + 20
    for number in range(3, last):
        follower.on_delta(landmark_delta(number))
    for number in range(3):
        follower.on_delta(landmark_delta(number))
    assert follower.request() is None and follower.next_delta == MAX_WAITING + 2, "the last ones are to be told again"
    for number in range(follower.next_delta, last):
        follower.on_delta(landmark_delta(number))
    assert follower.next_delta == last


def test_what_an_answer_holds_is_asked_for_once() -> None:
    pages, deltas = Request(0, snapshot=40, page=1), Request(7)
    assert Request(0, 40, MAX_PAGES).is_answered_with(pages)
    assert not Request(0, 40, 1 + MAX_PAGES).is_answered_with(pages)
    assert not Request(0, 41, 2).is_answered_with(pages), "of another snapshot"
    assert Request(6 + MAX_DELTAS).is_answered_with(deltas)
    assert not Request(7 + MAX_DELTAS).is_answered_with(deltas)


def test_a_late_listener_gets_the_map_page_by_page() -> None:
    follower = MapFollower()
    assert follower.request() == Request(next_delta=0)
    follower.on_delta(landmark_delta(41))
    assert not follower.on_page(make_page(40, 0, 2, two_views()))
    assert follower.request() == Request(next_delta=0, snapshot=40, page=1)
    assert not follower.on_page(make_page(40, 0, 2, two_views())), "a page that was not asked for"
    assert follower.on_page(make_page(40, 1, 2, make_change(landmarks=[make_landmark(7, (0.0, 0.0, 1.0))])))
    assert ids_of(follower) == [3, 5, 7, 510]
    assert follower.next_delta == 42
    assert follower.request() is None


def test_a_change_that_does_not_fit_is_answered_by_asking_for_the_whole_map() -> None:
    follower = MapFollower()
    follower.on_delta(landmark_delta(0))
    assert not follower.on_delta(make_delta(1, make_change(removed_keyframes=[12])))
    assert follower.request() is not None
    assert follower.on_page(make_page(1, 0, 1, two_views()))
    assert ids_of(follower) == [3, 5]
    assert follower.next_delta == 2


def test_pages_for_others_change_nothing() -> None:
    follower = MapFollower()
    follower.on_delta(landmark_delta(0))
    assert not follower.on_page(make_page(5, 0, 1, two_views()))
    assert ids_of(follower) == [100]
