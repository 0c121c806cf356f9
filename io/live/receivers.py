"""Where JSON lines are sent: a topic of an MQTT broker, a WebSocket, or an address for HTTP POST."""

from __future__ import annotations

import urllib.request
from collections.abc import Callable
from contextlib import suppress
from http.client import HTTPException
from threading import Thread
from typing import Any, Protocol
from urllib.parse import SplitResult, urlsplit

from stseg.errors import ConfigError
from stseg.io.extras import load_extra
from stseg.io.recording.recording import mask_passwords

_TIMEOUT = 5.0
"""Longest wait for an answer, seconds."""
_MQTT_PORT = 1883
_EXPECTED = "mqtt://HOST[:PORT]/TOPIC, ws://HOST/PATH, wss://HOST/PATH, http://HOST/PATH or https://HOST/PATH"


class Receiver(Protocol):
    """Where messages go."""

    def send(self, message: bytes) -> None:
        """Send a message; OSError where it was not received."""

    def close(self) -> None:
        """End the connection."""


class HttpReceiver:
    """Each message is the body of one POST request, of type application/x-ndjson."""

    def __init__(self, address: SplitResult) -> None:
        self._url = address.geturl()

    def send(self, message: bytes) -> None:
        """Post it; any answer but success is an error."""
        request = urllib.request.Request(self._url, message, {"Content-Type": "application/x-ndjson"})
        try:
            with urllib.request.urlopen(request, timeout=_TIMEOUT):  # of http or https alone, see `receiver_of`
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
            self._client.username_pw_set(address.username, address.password)
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
        self._url = address.geturl()
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
        connection = self._library.connect(self._url, open_timeout=_TIMEOUT, close_timeout=_TIMEOUT)
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
    """The receiver at an address.

    Raises
    ------
    ConfigError
        Where it is none, or its library is not installed.
    """
    try:
        parts = urlsplit(address)
        whole = bool(parts.hostname) and parts.port != 0 and not parts.fragment
        whole = whole and (parts.scheme != "mqtt" or len(parts.path) > 1)
    except ValueError:
        whole = False
    if not whole or parts.scheme not in _RECEIVERS or not address.isprintable():
        raise ConfigError("--publish", "", repr(mask_passwords(address)), _EXPECTED)
    return _RECEIVERS[parts.scheme](parts)
