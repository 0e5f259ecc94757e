"""An RTSP server on loopback that plays JPEG images in a loop, for the system's Python with GStreamer's bindings.

/usr/bin/python3 rtsp_server.py PORT PATTERN NUMBER WIDTH HEIGHT RATE     (PATTERN such as /tmp/x/%06d.jpg)
"""

import itertools
import sys
from pathlib import Path

import gi  # type: ignore[import-not-found]

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # type: ignore[import-not-found]  # noqa: E402


def main() -> None:
    port, pattern, number, width, height, rate = sys.argv[1:]
    Gst.init(None)
    images = [Path(pattern % index).read_bytes() for index in range(int(number))]
    caps = f"image/jpeg,width={width},height={height},framerate={rate}/1"
    factory = GstRtspServer.RTSPMediaFactory()
    factory.set_launch(
        f'( appsrc name=images is-live=true do-timestamp=true format=time caps="{caps}" ! rtpjpegpay name=pay0 pt=26 )'
    )
    factory.connect("media-configure", lambda _, media: play(media, images, int(rate)))
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    server.get_mount_points().add_factory("/camera", factory)
    server.attach(None)
    print("ready", flush=True)
    GLib.MainLoop().run()


def play(media: "GstRtspServer.RTSPMedia", images: list[bytes], rate: int) -> None:
    """One client's images, stamped with the time at which they are sent, until it is gone."""
    source = media.get_element().get_by_name_recurse_up("images")
    endless = itertools.cycle(images)

    def push() -> bool:
        return source.emit("push-buffer", Gst.Buffer.new_wrapped(next(endless))) == Gst.FlowReturn.OK

    GLib.timeout_add(1000 // rate, push)


main()
