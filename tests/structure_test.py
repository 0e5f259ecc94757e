"""The shape of modules/: no include cycles, and every header is known to a test."""

from helpers.includes import MODULES, ROOT, own_includes

# Headers that no test includes itself, each with what covers it. A new header belongs in a test, not in this list.
COVERED_BY_OTHERS = {
    "core/session_actions.h": "what sessions return; used by the tests of every session",
    "datasets/recording.h": "made and read by kitti_test, euroc_test, tum_test",
    "datasets/stream_source.h": "opened by frame_source_test as video:FILE",
    "datasets/video_input.h": "opened by frame_source_test as video:FILE",
    "features/simd.h": "every path of it runs in steps_test",
    "geometry/keypoint_noise.h": "constants",
    "geometry/similarity_problem.h": "inside of similarity_test",
    "loop_closing/relocalization.h": "relocalization_test asks it by the loop closer",
    "map/map_exchange.h": "values; map_follower_test exchanges them",
    "matching/point_id.h": "a value; map_replica_test and point_matching_test use it",
    "messages/end_of_stream.h": "a value; codec_test",
    "messages/loop_types.h": "values; codec_test",
    "messages/recorded_steps.h": "a value; recorded_steps_test",
    "messages/stage_messages.h": "values; codec_test",
    "messages/stream_messages.h": "values; codec_test",
    "optimization/bundle_solver.h": "inside of bundle_adjustment_test",
    "optimization/bundle_summary.h": "a value; bundle_adjustment_test",
    "optimization/ceres_options.h": "constants",
    "optimization/schur_solver.h": "bundle_adjustment_test compares it with Ceres",
    "runtime/clock.h": "an interface; the memory bus of the tests implements it",
    "runtime/incoming_streams.h": "inside of memory_bus_test",
    "runtime/map_subscription.h": "mapping_pipeline_test and revival_test follow the map by it",
    "runtime/outgoing_streams.h": "inside of memory_bus_test",
    "runtime/value_receiver.h": "inside of memory_bus_test",
    "settings/sections.h": "default_settings_test reads every section",
    "simulation/texture.h": "inside of renderer_test",
    "simulation/world.h": "inside of renderer_test",
    "stages/camera/log_source.h": "pipeline_test plays a log by it",
    "wire/bytes.h": "an alias",
    "wire/codec_impl.h": "inside of codec_test",
    "wire/keypoints_layout.h": "inside of codec_test",
    "wire/layout.h": "inside of codec_test",
    "wire/part_reader.h": "inside of codec_test and hostile_bytes_test",
    "wire/part_writer.h": "inside of codec_test",
}


def headers() -> dict[str, set[str]]:
    """Every header of modules/ with the headers that it includes itself."""
    return {str(path.relative_to(MODULES)): own_includes(path) for path in sorted(MODULES.rglob("*.h"))}


def included_by_tests() -> set[str]:
    sources = [
        path
        for path in (ROOT / "tests").rglob("*")
        if path.suffix in (".h", ".cc") and path.parent.name not in ("benchmarks", "fuzz")
    ]
    return {header for path in sources for header in own_includes(path)}


def find_cycle(graph: dict[str, set[str]]) -> list[str]:
    """The first cycle of a depth-first search, as the path around it; empty if there is none."""
    done: set[str] = set()
    path: list[str] = []

    def visit(node: str) -> list[str]:
        if node in path:
            return [*path[path.index(node) :], node]
        if node in done or node not in graph:
            return []
        path.append(node)
        for following in sorted(graph[node]):
            if cycle := visit(following):
                return cycle
        path.pop()
        done.add(node)
        return []

    for node in sorted(graph):
        if cycle := visit(node):
            return cycle
    return []


def test_a_cycle_is_found() -> None:
    assert find_cycle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert find_cycle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_headers_have_no_cycles() -> None:
    assert find_cycle(headers()) == []


def test_every_header_is_included_by_a_test() -> None:
    untested = set(headers()) - included_by_tests()
    assert untested == set(COVERED_BY_OTHERS), "headers without a test, or with one that the list does not know of"
