"""What `--publish` sends arrives at a real MQTT broker, by WebSocket and by HTTP; a missing receiver costs nothing."""

import asyncio
import json
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock, Mock

import numpy as np
import pytest
from arrivals import meanwhile
from checks import Command, refused
from run_files import table_of

from stseg.arrays import Rows
from stseg.errors import ConfigError
from stseg.io.live.live_tables import LiveTable
from stseg.io.live.publishing import Publisher, receiver_of
from stseg.records.tables import TRAJECTORY

PERSON = {"id": 3, "x": 1.25, "y": -0.5, "height": 1.7, "score": 4.0}
EXPECTED = [{"frame": frame, "time": frame / 5, **PERSON} for frame in (7, 8, 9)]


def rows_of(*frames: int) -> Rows:
    """The person in each of some frames."""
    return table_of(TRAJECTORY, frame=frames, **PERSON)


def publisher_to(address: str, said: Callable[[str], None] = pytest.fail) -> Publisher:
    return Publisher(receiver_of(address), 5.0, said)


@pytest.mark.parametrize(
    ("address", "library"),
    [("mqtt://h/t", {"Client.return_value.publish.return_value.is_published.return_value": False}),
     ("ws://h/t", {"connect.return_value.ping.return_value.wait.return_value": False,
                   "connect.return_value.__iter__": Mock(return_value=iter(())), "WebSocketException": OSError})],
)  # fmt: skip
def test_unconfirmed_is_not_sent(address: str, library: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stseg.io.live.publishing.load_extra", lambda *_: MagicMock(**library))
    refused(OSError, "no answer of the", receiver_of(address).send, b"")


@pytest.fixture
def free_port() -> int:
    """A port at which nobody listens."""
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        return int(unused.getsockname()[1])


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receiver that failed is tried again at once."""
    monkeypatch.setattr("stseg.io.live.publishing._RETRY", 0.05)


def parsed(bodies: list[bytes]) -> list[object]:
    return [json.loads(line) for body in bodies for line in body.splitlines()]


def wait_for(condition: Callable[[], object], seconds: float = 30) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)


@pytest.fixture
def posted() -> Iterator[tuple[str, list[bytes], list[int]]]:
    """An HTTP server: its address, the bodies that it got, and answers that it still gives before 200."""
    bodies, answers = list[bytes](), list[int]()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            status = answers.pop(0) if answers else 200
            if status == 200:
                bodies.append(body)
            self.send_response(status)
            self.send_header("Location", "/elsewhere")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = meanwhile(server.serve_forever)
    yield f"http://127.0.0.1:{server.server_port}/tracks", bodies, answers
    server.shutdown()
    thread.join()
    server.server_close()


def test_rows_arrive_by_http_with_passwords_and_open_heights(
    posted: tuple[str, list[bytes], list[int]], tmp_path: Path
) -> None:
    address, bodies, _ = posted
    with publisher_to(address) as publisher:
        publisher.append(rows_of(7, 8))
        publisher.append(rows_of())
        publisher.append(rows_of(9))
    assert [len(body.splitlines()) for body in bodies] == [2, 1] and parsed(bodies) == EXPECTED
    bodies.clear()
    with publisher_to(address.replace("://", "://me:s%20cret@")) as publisher:
        publisher.append(rows_of(7))
    assert len(bodies) == 1
    bodies.clear()
    rows = rows_of(7)
    rows["height"] = np.nan
    with publisher_to(address) as publisher, LiveTable(tmp_path / "live.csv", 5.0, 0) as live:
        publisher.append(rows)
        live.append(rows)
    assert parsed(bodies) == [{**EXPECTED[0], "height": None}]
    assert LiveTable(live.path, 5.0, 8).rows[["frame", "id", "x", "y"]].tolist() == [(7, 3, 1.25, -0.5)]


@pytest.mark.parametrize("failures", [[503, 503], [302], [307]])
def test_a_receiver_that_fails_gets_all(posted: tuple[str, list[bytes], list[int]], failures: list[int]) -> None:
    """Redirects are failures: they would be followed without the rows."""
    address, bodies, answers = posted
    answers += failures
    said: list[str] = []
    with publisher_to(address, said.append) as publisher:
        publisher.append(rows_of(7))
        wait_for(lambda: bodies)
        publisher.append(rows_of(8, 9))
    assert parsed(bodies) == EXPECTED
    assert [line.split(" (")[0] for line in said] == ["publishing waits for its receiver", "publishing goes on"]


def test_errors_are_one_line_without_passwords() -> None:
    said: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(b"what?\r\n")

        thread = meanwhile(answer)
        with publisher_to(f"http://127.0.0.1:{server.getsockname()[1]}/", said.append) as publisher:
            publisher.append(rows_of(7))
            wait_for(lambda: said, 5)
        thread.join(10)
    assert said[0].startswith("publishing waits for its receiver (") and "\n" not in said[0]
    reported = list[str]()
    with Publisher(Mock(send=Mock(side_effect=OSError("\x1b http://a:word@h"))), 5.0, reported.append) as publisher:
        publisher.append(rows_of(7))
        wait_for(lambda: reported)
    assert reported[0] == r"publishing waits for its receiver (\x1b http://a:***@h)"


def test_missing_receivers_or_libraries_delay_nothing(monkeypatch: pytest.MonkeyPatch, free_port: int) -> None:
    monkeypatch.setattr("stseg.io.live.publishing._WAITING", 10)
    said: list[str] = []
    begun = time.monotonic()
    with publisher_to(f"http://127.0.0.1:{free_port}/", said.append) as publisher:
        for frame in range(30):
            publisher.append(rows_of(frame))
        assert time.monotonic() - begun < 2
    assert time.monotonic() - begun < 10 and said[-1].startswith("30 messages were not published")
    monkeypatch.setitem(sys.modules, "websockets.sync.client", None)
    refused(ConfigError, r"pip install 'stseg\[websocket\]'", receiver_of, "ws://127.0.0.1/")
    monkeypatch.setattr("stseg.io.live.publishing.load_extra", library := Mock())
    receiver_of("mqtt://us%40r:p%40ss@h/t")
    assert library.return_value.Client.return_value.username_pw_set.call_args.args == ("us@r", "p@ss")


BAD_ADDRESSES = (
    "file:///etc/passwd mqtt://host mqtt:///topic http:// x http://[ http://a:b/ ftp://a/b ws:///path ws://a/b#c"
)


@pytest.mark.parametrize("address", BAD_ADDRESSES.split())
def test_other_addresses_are_refused(address: str) -> None:
    refused(ConfigError, r"expected mqtt://HOST\[:PORT\]/TOPIC", receiver_of, address)


def test_publishing_needs_follow(tmp_path: Path, refusal: Command) -> None:
    (tmp_path / "rig.toml").write_text("")
    refusal("run", tmp_path / "rig.toml", "-o", "x.h5", "--publish", "http://127.0.0.1:9/")


@contextmanager
def listening_socket(handle: Callable[[Any], None], port: int = 0) -> Iterator[int]:
    """A WebSocket server that gives each connection to `handle`; its port."""
    serving = pytest.importorskip("websockets.sync.server")
    with serving.serve(handle, "127.0.0.1", port) as server:
        thread = meanwhile(server.serve_forever)
        yield server.socket.getsockname()[1]
        server.shutdown()
        thread.join()


def test_rows_arrive_at_a_web_socket_that_answers_a_lot() -> None:
    """More answers to each message than a connection holds unread."""
    bodies: list[bytes] = []
    paths: list[str] = []

    def handle(connection: Any) -> None:
        paths.append(connection.request.path)
        for text in connection:
            bodies.append(text.encode())
            for _ in range(40):
                connection.send("thank you")

    with listening_socket(handle) as port, publisher_to(f"ws://127.0.0.1:{port}/hall?live=1") as publisher:
        publisher.append(rows_of(7, 8))
        publisher.append(rows_of(9))
        wait_for(lambda: len(bodies) == 2)
    assert [len(body.splitlines()) for body in bodies] == [2, 1]
    assert parsed(bodies) == EXPECTED and paths == ["/hall?live=1"]


def test_a_web_socket_that_breaks_is_opened_again() -> None:
    messages: list[str] = []
    sent, closed = threading.Event(), threading.Event()

    def handle(connection: Any) -> None:
        for text in connection:
            messages.append(text)
            if text == "first":
                sent.wait(10)
                connection.close()
                closed.set()

    with listening_socket(handle) as port:
        receiver = receiver_of(f"ws://127.0.0.1:{port}/")
        receiver.send(b"first")
        sent.set()
        assert closed.wait(10)
        refused(OSError, "1000", receiver.send, b"second")
        receiver.send(b"second")
        wait_for(lambda: len(messages) == 2)
        receiver.close()
    assert messages == ["first", "second"]


def test_a_web_socket_that_comes_late_is_one_line_and_another(free_port: int) -> None:
    said: list[str] = []
    bodies: list[bytes] = []
    with publisher_to(f"ws://127.0.0.1:{free_port}/", said.append) as publisher:
        publisher.append(rows_of(7, 8, 9))
        wait_for(lambda: said)
        time.sleep(0.2)
        with listening_socket(lambda connection: bodies.extend(text.encode() for text in connection), free_port):
            wait_for(lambda: bodies and len(said) == 2)
    assert said[0].startswith("publishing waits for its receiver (") and "refused" in said[0]
    assert said[1:] == ["publishing goes on"] and parsed(bodies) == EXPECTED


def test_a_web_server_that_is_none_of_sockets_is_one_line(posted: tuple[str, list[bytes], list[int]]) -> None:
    pytest.importorskip("websockets.sync.client")
    said: list[str] = []
    with publisher_to(posted[0].replace("http", "ws"), said.append) as publisher:
        publisher.append(rows_of(7))
        wait_for(lambda: said)
    assert said == [
        "publishing waits for its receiver (did not receive a valid HTTP response)",
        "1 messages were not published; the live table has their rows",
    ]


def test_rows_arrive_at_a_broker(free_port: int) -> None:
    broker = pytest.importorskip("amqtt.broker")
    client = pytest.importorskip("amqtt.client")
    pytest.importorskip("paho.mqtt.client")
    bodies: list[bytes] = []
    listening = threading.Event()

    async def serve() -> None:
        plugins = {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}}
        listeners = {"default": {"type": "tcp", "bind": f"127.0.0.1:{free_port}"}}
        own = broker.Broker({"listeners": listeners, "plugins": plugins})
        await own.start()
        reader = client.MQTTClient(config={"auto_reconnect": False})
        await reader.connect(f"mqtt://127.0.0.1:{free_port}/")
        await reader.subscribe([("hall/tracks", 1)])
        listening.set()
        while len(bodies) < 2:
            message = await reader.deliver_message(timeout_duration=30)
            bodies.append(bytes(message.publish_packet.payload.data))
        await reader.disconnect()
        await own.shutdown()

    thread = meanwhile(lambda: asyncio.run(serve()))
    assert listening.wait(30)
    with publisher_to(f"mqtt://127.0.0.1:{free_port}/hall/tracks") as publisher:
        publisher.append(rows_of(7, 8))
        publisher.append(rows_of(9))
        wait_for(lambda: len(bodies) == 2)
    thread.join(30)
    assert parsed(bodies) == EXPECTED
