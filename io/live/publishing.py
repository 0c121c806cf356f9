"""Rows of the live table, and corrections of its ids, sent on as JSON lines.

They go to a topic of an MQTT broker, a WebSocket, or an address for HTTP POST. A thread sends what a queue holds, so a
slow or missing receiver never delays tracking. While it cannot be reached the newest messages wait, as many as
`_WAITING`; older ones are dropped, and the live table has them still.
"""

from __future__ import annotations

import json
import math
import urllib.request
from base64 import b64encode
from collections.abc import Callable, Sequence
from contextlib import suppress
from http.client import HTTPException
from queue import Empty, Full, Queue
from threading import Event, Thread
from typing import Any, Protocol, Self
from urllib.parse import SplitResult, unquote, urlsplit

from stseg.arrays import Rows
from stseg.errors import ConfigError, printable
from stseg.io.extras import load_extra
from stseg.io.live.live_tables import COLUMNS
from stseg.io.recording.recording import mask_passwords

_WAITING = 1000
"""Messages that wait for a receiver, one a window."""
_RETRY = 2.0
"""Time between attempts, seconds."""
_ENDING = 10.0
"""Longest time in which the last messages are sent after the run, seconds."""
_TIMEOUT = 5.0
"""Longest wait for an answer, seconds."""
_MQTT_PORT = 1883
_EXPECTED = "mqtt://HOST[:PORT]/TOPIC, ws://HOST/PATH, wss://HOST/PATH, http://HOST/PATH or https://HOST/PATH"


class Publisher:
    """Sends rows of tracks to a receiver while it is open, at a rate of frames per second.

    `report` receives a line when the receiver stops to answer, when it is back, and of what was dropped.
    """

    def __init__(self, receiver: Receiver, frame_rate: float, report: Callable[[str], None]) -> None:
        self._receiver, self._frame_rate, self._report = receiver, frame_rate, report
        self._messages: Queue[bytes] = Queue(_WAITING)
        self._dropped, self._ending, self._leaving = 0, Event(), Event()
        self._thread = Thread(target=self._run, name="publisher", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *reason: object) -> None:
        self._ending.set()
        self._thread.join(_ENDING)
        self._leaving.set()
        left = self._dropped + self._messages.qsize()
        if left:
            self._report(f"{left} messages were not published; the live table has their rows")

    def append(self, rows: Rows) -> None:
        """Send TRAJECTORY rows as one message, a JSON object a line; returns at once."""
        if not len(rows):
            return
        self._send([self._object(row) for row in rows])

    def correct(self, corrections: Rows) -> None:
        """Send CORRECTION rows as one message likewise."""
        if len(corrections):
            self._send([dict(zip(COLUMNS, one, strict=True)) for one in corrections.tolist()])

    def _send(self, objects: Sequence[dict[str, object]]) -> None:
        message = "".join(f"{json.dumps(one)}\n" for one in objects).encode()
        while True:
            try:
                self._messages.put_nowait(message)
                return
            except Full:
                with suppress(Empty):
                    self._messages.get_nowait()
                    self._dropped += 1

    def _object(self, row: Any) -> dict[str, object]:
        frame = int(row["frame"])
        about: dict[str, object] = {"frame": frame, "time": round(frame / self._frame_rate, 3), "id": int(row["id"])}
        numbers = {name: float(row[name]) for name in ("x", "y", "height", "score")}
        return about | {name: round(value, 3) if math.isfinite(value) else None for name, value in numbers.items()}

    def _run(self) -> None:
        while not (self._ending.is_set() and self._messages.empty()):
            try:
                message = self._messages.get(timeout=0.1)
            except Empty:
                continue
            if not self._deliver(message):
                self._dropped += 1
                break
        with suppress(OSError):
            self._receiver.close()

    def _deliver(self, message: bytes) -> bool:
        """Send a message, again and again until it is received; whether it was before the end."""
        is_failing = False
        while True:
            try:
                self._receiver.send(message)
            except (OSError, ValueError, LookupError, RuntimeError) as error:  # libraries raise many for odd answers
                if not is_failing:
                    self._report(f"publishing waits for its receiver ({printable(mask_passwords(str(error)))})")
                is_failing = True
                if self._leaving.wait(_RETRY) or self._ending.is_set():
                    return False
            else:
                if is_failing:
                    self._report("publishing goes on")
                return True


class Receiver(Protocol):
    """Where messages go."""

    def send(self, message: bytes) -> None:
        """Send a message; OSError where it was not received."""

    def close(self) -> None:
        """End the connection."""


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """A redirect is an error: it would be followed without the message, to any host."""

    def redirect_request(self, *_: object) -> None:
        """None of them."""


def _without_login(address: SplitResult) -> tuple[str, dict[str, str]]:
    """An address without its login, and the header that carries that."""
    url = address._replace(netloc=address.netloc.rpartition("@")[2]).geturl()
    if address.username is None:
        return url, {}
    login = f"{unquote(address.username)}:{unquote(address.password or '')}"
    return url, {"Authorization": f"Basic {b64encode(login.encode()).decode()}"}


class HttpReceiver:
    """Each message is the body of one POST request, of type application/x-ndjson."""

    def __init__(self, address: SplitResult) -> None:
        self._url, login = _without_login(address)
        self._headers = {"Content-Type": "application/x-ndjson"} | login
        self._opener = urllib.request.build_opener(_NoRedirects)

    def send(self, message: bytes) -> None:
        """Post it; any answer but success is an error."""
        request = urllib.request.Request(self._url, message, self._headers)
        try:
            with self._opener.open(request, timeout=_TIMEOUT):  # of http or https alone, see `receiver_of`
                pass
        except HTTPException as error:
            raise OSError(f"no answer of HTTP: {error!r}") from error

    def close(self) -> None:
        """Each request has a connection of its own."""


class MqttReceiver:
    """Each message is published to one topic, at least once (quality of service 1)."""

    def __init__(self, address: SplitResult) -> None:
        mqtt = load_extra("paho.mqtt.client", "mqtt")
        self._address, self._topic = address, address.path.lstrip("/")
        self._client: Any = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        if address.username is not None:
            self._client.username_pw_set(unquote(address.username), unquote(address.password or ""))
        self._is_begun = False

    def send(self, message: bytes) -> None:
        """Publish it, and wait until the broker has it."""
        if not self._is_begun:
            self._client.connect(self._address.hostname, self._address.port or _MQTT_PORT)
            self._client.loop_start()
            self._is_begun = True
        try:
            sent = self._client.publish(self._topic, message, qos=1)
            sent.wait_for_publish(_TIMEOUT)
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from error
        if not sent.is_published():
            raise OSError("no answer of the broker")

    def close(self) -> None:
        """Leave the broker."""
        if self._is_begun:
            self._client.disconnect()
            self._client.loop_stop()


class WebSocketReceiver:
    """Each message is one text message over a connection that stays open, and is opened again where it breaks."""

    def __init__(self, address: SplitResult) -> None:
        self._library = load_extra("websockets.sync.client", "websocket")
        self._broken: type[Exception] = load_extra("websockets.exceptions", "websocket").WebSocketException
        self._url, self._login = _without_login(address)
        self._connection: Any = None

    def send(self, message: bytes) -> None:
        """Send it, and wait for the answer to a ping behind it: a WebSocket confirms no message."""
        try:
            connection = self._connection = self._connection or self._connect()
            connection.send(message.decode())
            is_received = connection.ping().wait(_TIMEOUT)
        except self._broken as error:
            self.close()
            raise OSError(str(error)) from error
        if not is_received:
            self.close()
            raise OSError("no answer of the WebSocket")

    def close(self) -> None:
        """Close the connection."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _connect(self) -> Any:
        waits = {"open_timeout": _TIMEOUT, "close_timeout": _TIMEOUT}
        connection = self._library.connect(self._url, additional_headers=self._login, **waits)
        Thread(target=self._discard, args=(connection,), name="discarded messages", daemon=True).start()
        return connection

    def _discard(self, connection: Any) -> None:
        """Read what the other end sends: unread messages would hold up the answers to pings."""
        with suppress(self._broken):
            for _ in connection:
                pass


_RECEIVERS: dict[str, Callable[[SplitResult], Receiver]] = {
    "mqtt": MqttReceiver,
    "ws": WebSocketReceiver,
    "wss": WebSocketReceiver,
    "http": HttpReceiver,
    "https": HttpReceiver,
}


def receiver_of(address: str) -> Receiver:
    """The receiver at an address. ConfigError where it is none, or its library is not installed."""
    try:
        parts = urlsplit(address)
        whole = bool(parts.hostname) and parts.port != 0 and not parts.fragment
        whole = whole and (parts.scheme != "mqtt" or len(parts.path) > 1)
    except ValueError:
        whole = False
    if not whole or parts.scheme not in _RECEIVERS or not address.isprintable():
        raise ConfigError("--publish", "", repr(mask_passwords(address)), _EXPECTED)
    return _RECEIVERS[parts.scheme](parts)
