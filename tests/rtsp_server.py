"""Serve videos as RTSP streams of cameras that run in step, with GStreamer: rtsp_server.py PORT NAME=FILE...

The cameras run by one clock whether anybody looks or not, so whoever connects sees the present. When a video is
over the streams end, and after a second all of them begin again. Once it listens it says `ready` and the port, else
what it misses. It runs under the system's Python, which alone has GStreamer's bindings.
"""

import sys
from typing import Any

CAMERA = (
    "filesrc location={path} ! decodebin ! videoconvert ! video/x-raw,format=I420 ! appsink name={name} max-buffers=2"
)
STREAM = (
    "( appsrc name=source is-live=true do-timestamp=true format=time ! "
    "x264enc tune=zerolatency speed-preset=ultrafast bitrate=4000 key-int-max=4 ! "
    "rtph264pay name=pay0 pt=96 config-interval=1 )"
)
ELEMENTS = ("x264enc", "rtph264pay", "avidemux", "jpegdec", "appsrc")


def main() -> None:
    port, *streams = sys.argv[1:]
    try:
        import gi

        gi.require_version("Gst", "1.0")
        gi.require_version("GstApp", "1.0")
        gi.require_version("GstRtspServer", "1.0")
        from gi.repository import GLib, Gst, GstApp, GstRtspServer
    except (ImportError, ValueError) as error:
        say(f"no GStreamer RTSP server: {error}")
        return
    del GstApp  # gives appsrc its methods
    Gst.init(None)
    missing = [element for element in ELEMENTS if Gst.ElementFactory.find(element) is None]
    if missing:
        say(f"no GStreamer elements {', '.join(missing)}")
        return
    named = dict(stream.split("=", 1) for stream in streams)
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    sources: dict[str, list[Any]] = {name: [] for name in named}
    for name in named:
        factory = GstRtspServer.RTSPMediaFactory()
        factory.set_launch(STREAM)
        factory.connect("media-configure", lambda _, media, own: configure(media, own), sources[name])
        server.get_mount_points().add_factory(f"/{name}", factory)
    server.attach(None)
    playing: list[Any] = []

    def begin() -> bool:
        cameras = Gst.parse_launch(" ".join(CAMERA.format(path=path, name=name) for name, path in named.items()))
        for name in named:
            sink = cameras.get_by_name(name)
            sink.set_property("emit-signals", True)
            sink.connect("new-sample", lambda taken, own: show(taken, own, Gst), sources[name])
        bus = cameras.get_bus()
        bus.add_signal_watch()
        bus.connect("message::eos", end)
        cameras.set_state(Gst.State.PLAYING)
        playing.append(cameras)
        return False

    def end(*_: object) -> None:
        for own in sources.values():
            for source in own:
                source.emit("end-of-stream")
            own.clear()
        playing.pop().set_state(Gst.State.NULL)
        GLib.timeout_add(1000, begin)

    begin()
    say(f"ready {server.get_bound_port()}")
    GLib.MainLoop().run()


def configure(media: Any, own: list[Any]) -> None:
    """Somebody has connected."""
    source = media.get_element().get_child_by_name("source")
    own.append(source)
    media.connect("unprepared", lambda _: own.remove(source) if source in own else None)


def show(sink: Any, own: list[Any], gst: Any) -> Any:
    """The camera's next picture, for whoever looks."""
    sample = sink.emit("pull-sample")
    for source in list(own):
        if source.get_property("caps") is None:
            source.set_property("caps", sample.get_caps())
        picture = sample.get_buffer().copy()
        picture.pts = picture.dts = gst.CLOCK_TIME_NONE  # do-timestamp says when it is shown
        source.emit("push-buffer", picture)
    return gst.FlowReturn.OK


def say(line: str) -> None:
    """Tell whoever started this."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
