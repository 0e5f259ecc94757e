"""`tessera view` of a running stack: listens until the window is closed or Ctrl-C."""

import os
import time
from argparse import Namespace
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from tessera_cli import messages
from tessera_cli.cluster.keys import key_folder
from tessera_cli.console import say
from tessera_cli.constants import CAMERA, LISTEN_S, MAP_ASK_S, POSE, STATUS
from tessera_cli.lcm_bus import Bus, bus_url, is_on_lan, listen, stack_bus_url
from tessera_cli.membership import RunDir, run_dir_of, sign_message
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.viewing.bus_scene import BusScene
from tessera_cli.viewing.scene import INLIERS_PLOT, LATENCY_PLOT, QUEUES_PLOT, Look, Shown
from tessera_cli.viewing.window import View, open_view

if TYPE_CHECKING:
    from tessera_cli.viewing.rerun_sink import RerunSink

PICTURE_PERIOD_S = 0.2
MAP_PERIOD_S = 1.0
SILENCE_TOLD_S = 3.0


def view_bus(arguments: Namespace) -> int:
    lan = is_on_lan(arguments)
    with open_view(arguments, "live") as view:
        names = ["main", "map"] if arguments.no_images else ["main", "map", "camera"]
        urls = [stack_bus_url(name, arguments.port, lan) for name in names]
        opened = {url: Bus(url, f"viewer_{os.getpid()}", hears_images=True) for url in urls}
        buses = {name: opened[url] for name, url in zip(names, urls, strict=True)}
        sink = view.start(Look((INLIERS_PLOT, LATENCY_PLOT, QUEUES_PLOT)))
        run_dir = run_dir_of(key_folder(), bus_url(arguments.port), arguments.prefix)
        listener = _Listener(buses, arguments.prefix, run_dir, sink)
        view.tell()
        listener.run(view)
        view.explain_end()
    return 0


class _Listener:
    """Wires buses, scene and recording."""

    def __init__(self, buses: dict[str, Bus], prefix: str, run_dir: RunDir, sink: "RerunSink") -> None:
        """`buses`: main, map and perhaps camera; two of them may be one."""
        self._buses, self._prefix, self._sink = list(dict.fromkeys(buses.values())), prefix, sink
        self._run_dir = run_dir
        self._scene = BusScene()
        self._num_heard = 0
        self._asked_at = 0.0
        self._asked: Any = None
        scene, main, map_bus = self._scene, buses["main"], buses["map"]
        self._listen_to(main, "CALIBRATION", messages.calibration_t, scene.on_calibration)
        self._listen_to(main, POSE, messages.pose_t, scene.on_pose)
        self._listen_to(main, "GROUND_TRUTH", messages.ground_truth_t, scene.on_truth)
        self._listen_to(main, STATUS, messages.stage_status_t, scene.on_status)
        self._listen_to(map_bus, "FEATURES", messages.features_t, scene.on_features)
        self._listen_to(map_bus, "MAP_DELTA", messages.map_delta_t, scene.on_delta)
        self._listen_to(map_bus, "MAP_SNAPSHOT", messages.map_snapshot_t, scene.on_page)
        if "camera" in buses:
            self._listen_to(buses["camera"], CAMERA, messages.camera_image_t, scene.on_image)

    def run(self, view: View) -> None:
        """Until the view is closed."""
        began = time.monotonic()
        map_at = picture_at = began
        is_silence_told = False
        while not view.is_over:
            listen(self._buses, LISTEN_S)
            now = time.monotonic()
            if self._num_heard:
                self._ask_for_map(now)
            elif not is_silence_told and now - began > SILENCE_TOLD_S:
                is_silence_told = True
                say(
                    f"nothing is heard on {self._buses[0].url} yet: waiting for a run "
                    "(--port N and --prefix TEXT select another stack, --lan other machines)"
                )
            if now - picture_at > PICTURE_PERIOD_S:
                self._show(self._scene.pictures())
                picture_at = time.monotonic()
            if now - map_at > MAP_PERIOD_S:
                self._show(self._scene.map_shapes())
                map_at = time.monotonic()

    def _listen_to(self, bus: Bus, channel: str, message_type: Any, show: Callable[[Any], list[Shown]]) -> None:
        def on_bytes(data: bytes) -> None:
            message = decode_arrays(message_type, data)
            if message is not None:
                self._num_heard += 1
                self._show(show(message))

        bus.subscribe(self._prefix + channel, None, on_bytes)

    def _show(self, shapes: Iterable[Shown]) -> None:
        for shown in shapes:
            self._sink.show(shown)

    def _ask_for_map(self, now: float) -> None:
        """Each request once, until the next one or some time later: an answer is on its way."""
        request = self._scene.follower.request()
        if request is not None and (request != self._asked or now - self._asked_at > MAP_ASK_S):
            self._asked_at = now
            message = messages.map_request_t()
            bus = self._buses[0]
            message.header = bus.header(self._prefix + "MAP_REQUEST")
            message.next_delta, message.snapshot, message.page = request.next_delta, request.snapshot, request.page
            self._publish(bus, self._prefix + "MAP_REQUEST", message.encode())
        self._asked = request

    def _publish(self, bus: Bus, channel: str, data: bytes) -> None:
        """As a member of the run, if this user's keys say which; the mapper gives the map to nobody else."""
        secret = self._run_dir.secret()
        bus.publish(channel, sign_message(channel, data, secret) if secret else data)
