"""Serve a video as RTSP streams, in real time, with GStreamer: rtsp_server.py PORT NAME=FILE...

A stream ends when its video does, and begins again for whoever asks again. Once it listens it says `ready` and the
port, else what it misses. It runs under the system's Python, which alone has GStreamer's bindings.
"""

from __future__ import annotations

import sys

PIPELINE = (
    "( filesrc location={path} ! decodebin ! videoconvert ! video/x-raw,format=I420 ! "
    "x264enc tune=zerolatency speed-preset=ultrafast bitrate=4000 key-int-max=4 ! "
    "rtph264pay name=pay0 pt=96 config-interval=1 )"
)


def say(line: str) -> None:
    """Tell whoever started this."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Serve until killed."""
    port, *streams = sys.argv[1:]
    try:
        import gi

        gi.require_version("Gst", "1.0")
        gi.require_version("GstRtspServer", "1.0")
        from gi.repository import GLib, Gst, GstRtspServer
    except (ImportError, ValueError) as error:
        say(f"no GStreamer RTSP server: {error}")
        return
    Gst.init(None)
    for element in ("x264enc", "rtph264pay", "avidemux", "jpegdec"):
        if Gst.ElementFactory.find(element) is None:
            say(f"no GStreamer element {element}")
            return
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    for stream in streams:
        name, _, path = stream.partition("=")
        factory = GstRtspServer.RTSPMediaFactory()
        factory.set_launch(PIPELINE.format(path=path))
        factory.set_shared(True)
        server.get_mount_points().add_factory(f"/{name}", factory)
    server.attach(None)
    say(f"ready {server.get_bound_port()}")
    GLib.MainLoop().run()


if __name__ == "__main__":
    main()
