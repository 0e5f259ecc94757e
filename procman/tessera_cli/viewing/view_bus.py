"""`tessera view` of a running stack: listens until the window is closed or Ctrl-C."""

import os
import time
from argparse import Namespace
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tessera_cli import messages
from tessera_cli.cluster.keys import key_folder
from tessera_cli.console import say
from tessera_cli.constants import CAMERA, COLOR, LISTEN_S, MAP_ASK_S, POSE, STATUS
from tessera_cli.lcm_bus import Bus, bus_url, is_on_lan, listen, stack_bus_url
from tessera_cli.maps.map_follower import Request
from tessera_cli.membership import MEMBERS_ONLY, RunDir, run_dir_of, sign_message
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.viewing.bus_scene import BusScene
from tessera_cli.viewing.scene import INLIERS_PLOT, LATENCY_PLOT, QUEUES_PLOT, Look, Shown
from tessera_cli.viewing.window import View, open_view

if TYPE_CHECKING:
    from tessera_cli.viewing.rerun_sink import RerunSink

MOTION_PERIOD_S = 0.1
PICTURE_PERIOD_S = 0.2
MAP_PERIOD_S = 1.0
SILENCE_TOLD_S = 3.0
# Requests for the map without an answer, after which the view says why it shows none.
MAX_MAP_ASKED = 10
# An answer takes until the stage publishes next; on a bus that loses parts of it, asking often would make it worse.
OCCUPANCY_ASK_S = 5.0

LOOK = Look((INLIERS_PLOT, LATENCY_PLOT, QUEUES_PLOT))


def view_bus(arguments: Namespace) -> int:
    lan = is_on_lan(arguments)
    with open_view(arguments, "live") as view:
        names = ["main", "map"] if arguments.no_images else ["main", "map", "camera", "color"]
        urls = [stack_bus_url(name, arguments.port, lan) for name in names]
        opened = {url: Bus(url, f"viewer_{os.getpid()}", hears_images=True) for url in urls}
        buses = {name: opened[url] for name, url in zip(names, urls, strict=True)}
        sink = view.start(LOOK)
        run_dir = run_dir_of(key_folder(), bus_url(arguments.port), arguments.prefix)
        listener = _Listener(buses, arguments.prefix, run_dir, sink)
        view.tell()
        listener.run(view)
        view.explain_end()
    return 0


class _Listener:
    """Wires buses, scene and recording."""

    def __init__(self, buses: dict[str, Bus], prefix: str, run_dir: RunDir, sink: "RerunSink") -> None:
        """`buses`: main, map and perhaps camera and color; two of them may be one."""
        self._buses, self._prefix, self._sink = list(dict.fromkeys(buses.values())), prefix, sink
        self._run_dir = run_dir
        self._scene = BusScene()
        self._num_heard = 0
        self._asked_at = 0.0
        self._asked: Request | None = None
        self._num_map_asked = 0  # the same
        self._lacked: Request | None = None
        self._lacked_since = 0.0
        self._occupancy_asked_at = 0.0
        self._num_occupancy_asked = 0
        self._is_arranged = False  # for the size of the image
        scene, main, map_bus = self._scene, buses["main"], buses["map"]
        self._listen_to(main, "CALIBRATION", messages.calibration_t, scene.on_calibration)
        self._listen_to(main, POSE, messages.pose_t, scene.on_pose)
        self._listen_to(main, "GROUND_TRUTH", messages.ground_truth_t, scene.on_truth)
        self._listen_to(main, STATUS, messages.stage_status_t, scene.on_status)
        self._listen_to(main, "OCCUPANCY", messages.occupancy_t, scene.on_occupancy)
        self._listen_to(map_bus, "FEATURES", messages.features_t, scene.on_features)
        self._listen_to(map_bus, "MAP_DELTA", messages.map_delta_t, scene.on_delta)
        self._listen_to(map_bus, "MAP_SNAPSHOT", messages.map_snapshot_t, scene.on_page)
        if "camera" in buses:
            self._listen_to(buses["camera"], CAMERA, messages.camera_image_t, scene.on_image)
            self._listen_to(buses["color"], COLOR, messages.color_image_t, scene.on_color)

    def run(self, view: View) -> None:
        """Until the view is closed."""
        began = time.monotonic()
        map_at = picture_at = motion_at = began
        is_silence_told = False
        while not view.is_over:
            listen(self._buses, LISTEN_S)
            now = time.monotonic()
            if self._num_heard:
                self._ask_for_map(now)
                self._ask_for_occupancy(now)
            elif not is_silence_told and now - began > SILENCE_TOLD_S:
                is_silence_told = True
                say(
                    f"nothing is heard on {self._buses[0].url} yet: waiting for a run "
                    "(--port N and --prefix TEXT select another stack, --lan other machines)"
                )
            self._arrange_once()
            if now - motion_at > MOTION_PERIOD_S:
                self._show(self._scene.motion())
                motion_at = now
            if now - picture_at > PICTURE_PERIOD_S:
                self._show(self._scene.pictures())
                picture_at = time.monotonic()
            if now - map_at > MAP_PERIOD_S:
                self._show(self._scene.map_shapes())
                map_at = time.monotonic()

    def _listen_to(self, bus: Bus, channel: str, message_type: Any, handler: Callable[[Any], None]) -> None:
        def on_bytes(data: bytes) -> None:
            message = decode_arrays(message_type, data)
            if message is not None:
                self._num_heard += 1
                handler(message)

        bus.subscribe(self._prefix + channel, None, on_bytes)

    def _arrange_once(self) -> None:
        if self._scene.image_size and not self._is_arranged:
            self._is_arranged = True
            self._sink.arrange(replace(LOOK, image_size=self._scene.image_size))

    def _show(self, shapes: Iterable[Shown]) -> None:
        for shown in shapes:
            self._sink.show(shown)

    def _ask_for_map(self, now: float) -> None:
        """Once for each answer, and again when nothing of it has come for a while."""
        request = self._scene.follower.request()
        if request != self._lacked:
            self._lacked, self._lacked_since = request, now
        if request is None:
            return
        is_on_its_way = self._asked is not None and request.is_answered_with(self._asked)
        if is_on_its_way and now - max(self._asked_at, self._lacked_since) <= MAP_ASK_S:
            return
        self._num_map_asked = self._num_map_asked + 1 if request == self._asked else 1
        self._asked, self._asked_at = request, now
        if self._num_map_asked == MAX_MAP_ASKED and self._run_dir.secret() is None:
            say(f"the map is not shown: {MEMBERS_ONLY}")
        message = messages.map_request_t()
        bus = self._buses[0]
        message.header = bus.header(self._prefix + "MAP_REQUEST")
        message.next_delta, message.snapshot, message.page = request.next_delta, request.snapshot, request.page
        self._publish(bus, self._prefix + "MAP_REQUEST", message.encode())

    def _ask_for_occupancy(self, now: float) -> None:
        """Where a stage has it: all of it, at the start and when a message was lost."""
        is_wanted = self._scene.has_occupancy_stage and self._scene.occupancy.lacks_whole
        if is_wanted and now - self._occupancy_asked_at > OCCUPANCY_ASK_S:
            self._occupancy_asked_at = now
            message = messages.occupancy_request_t()
            bus = self._buses[0]
            message.header = bus.header(self._prefix + "OCCUPANCY_REQUEST")
            message.num_asked = self._num_occupancy_asked
            self._num_occupancy_asked += 1
            self._publish(bus, self._prefix + "OCCUPANCY_REQUEST", message.encode())

    def _publish(self, bus: Bus, channel: str, data: bytes) -> None:
        """As a member of the run, if this user's keys say which; the mapper gives the map to nobody else."""
        secret = self._run_dir.secret()
        bus.publish(channel, sign_message(channel, data, secret) if secret else data)
