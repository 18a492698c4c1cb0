"""A client of Socket.IO, as far as a simulator needs it that talks to a DevKit: one event by WebSocket, one namespace.

DevKits of the league have python-socketio 4, which speaks revision 3 of Engine.IO; newer ones speak revision 4. No one
library speaks both, so this module does. A server of revision 3 accepts a client that asks for 4, and then waits for
pings that this client would leave to the server. So revision 3 is asked for first: servers of revision 4 refuse it.
Source: the published protocols of Engine.IO and Socket.IO. It needs the extra `autodrive`.
"""

from __future__ import annotations

import contextlib
import json
import math
import threading
import time
from collections import deque
from typing import Any

from fg_mujoco.course.documents import parse_json
from fg_mujoco.errors import EngineError, missing_extra
from fg_mujoco.messages import shown

_OPEN, _CLOSE, _PING, _PONG, _MESSAGE = "0", "1", "2", "3", "4"  # of Engine.IO
_CONNECT, _DISCONNECT, _EVENT, _REFUSED = "0", "1", "2", "4"  # of Socket.IO, within a message
_REVISIONS = (3, 4)
_HANDSHAKE = 3.0  # [s]
_CLOSING = 1.0  # [s] that a server has to say goodbye
_PONG_WITHIN = 1.0  # [s] in which a server that is alive answers a ping of WebSocket
_LONGEST = 1 << 16  # bytes of a message; a command of two cars has 200
_MOST_WAITING = 16  # events that wait to be received: the newest
_INTERVALS = 10, 3_600_000  # [ms] between two pings, at least and at most


class Client:
    """An open connection. A thread of its own reads, answers pings and sends them, so that it outlives long pauses."""

    def __init__(self, socket: Any, revision: int, where: str, event: str) -> None:
        self.where, self._socket, self._revision, self._event = where, socket, revision, event
        self._ping_every = 25.0  # [s]
        self._shake_hands()
        self._waiting: deque[Any] = deque(maxlen=_MOST_WAITING)
        self._lost: EngineError | None = None
        self._changed = threading.Condition()
        threading.Thread(target=self._listen, name="devkit", daemon=True).start()

    def send(self, data: Any) -> None:
        """Send an event; EngineError: the connection is closed."""
        self._write(_MESSAGE + _EVENT + json.dumps([self._event, data], separators=(",", ":")))

    def receive(self, timeout: float) -> list[Any]:
        """Return the data of events since the last call, 16 at most, within [s]; TimeoutError: none; EngineError."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._waiting or self._lost, timeout):
                raise TimeoutError
            if not self._waiting:
                raise EngineError(str(self._lost))
            found = list(self._waiting)
            self._waiting.clear()
            return found

    def is_alive(self) -> bool:
        """Return whether the server's side answers a ping, whatever its handlers of events do."""
        from websockets.exceptions import WebSocketException

        try:
            return bool(self._socket.ping().wait(_PONG_WITHIN))
        except (WebSocketException, OSError):
            return False

    def close(self) -> None:
        """Close the connection."""
        with contextlib.suppress(EngineError):
            self._write(_MESSAGE + _DISCONNECT)
        self._socket.close()

    def _shake_hands(self) -> None:
        until = time.monotonic() + _HANDSHAKE
        try:
            opened = self._read(until)
            settings = _json(opened[1:]) if opened[:1] == _OPEN else None
            if not isinstance(settings, dict):
                raise EngineError(f"{self.where} does not speak Socket.IO: it began with {opened[:40]!r}")
            interval = settings.get("pingInterval", 25_000)
            if type(interval) not in (int, float) or not _INTERVALS[0] <= interval <= _INTERVALS[1]:
                accepted = f"{_INTERVALS[0]} to {_INTERVALS[1]} ms"
                raise EngineError(f"{self.where} asks for pings each {shown(interval)}; accepted: {accepted}")
            self._ping_every = interval / 1000.0
            if self._revision > 3:  # before that, the server connects by itself
                self._write(_MESSAGE + _CONNECT)
            while not (answer := self._read(until)).startswith(_MESSAGE + _CONNECT):
                if answer.startswith(_MESSAGE + _REFUSED):
                    raise EngineError(f"{self.where} refuses the connection: {answer[2:80]}")
        except TimeoutError as error:
            raise EngineError(f"{self.where} does not speak Socket.IO: no handshake within {_HANDSHAKE:g} s") from error

    def _listen(self) -> None:
        """Read until the connection is closed, and keep it open: in revision 3 it is the client that pings."""
        due = time.monotonic() if self._revision == 3 else math.inf
        while self._lost is None:
            try:
                if time.monotonic() >= due:
                    due = time.monotonic() + 0.5 * self._ping_every
                    self._write(_PING)
                self._take(self._read(min(due, time.monotonic() + self._ping_every)))
            except TimeoutError:
                continue
            except EngineError as error:
                with self._changed:
                    self._lost = error
                    self._changed.notify()

    def _take(self, packet: str) -> None:
        """Keep the data of an event, and answer what asks for an answer."""
        if packet[:1] == _PING:
            self._write(_PONG + packet[1:])
        elif packet[:1] == _CLOSE or packet[:2] == _MESSAGE + _DISCONNECT:
            raise self._closed()
        elif packet[:2] == _MESSAGE + _EVENT:
            found = _json(packet[2:].lstrip("0123456789"))  # an id, if an acknowledgement is asked for
            if isinstance(found, list) and found[:1] == [self._event]:
                with self._changed:
                    self._waiting.append(found[1] if len(found) > 1 else None)
                    self._changed.notify()

    def _write(self, packet: str) -> None:
        from websockets.exceptions import WebSocketException

        try:
            self._socket.send(packet)
        except (WebSocketException, OSError) as error:
            raise self._closed() from error

    def _read(self, until: float) -> str:
        from websockets.exceptions import WebSocketException

        left = until - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        try:
            packet = self._socket.recv(timeout=left)
        except TimeoutError:
            raise
        except (WebSocketException, OSError) as error:
            raise self._closed() from error
        return packet if isinstance(packet, str) else ""  # bytes belong to binary events, which DevKits do not send

    def _closed(self) -> EngineError:
        return EngineError(
            f"{self.where} has closed the connection: it has ended, or an exception has, which its own terminal shows"
        )


def open_client(host: str, port: int, event: str) -> Client:
    """Return a connection to a server of Socket.IO for one event; EngineError: none is there; MissingExtraError."""
    try:
        from websockets.exceptions import InvalidHandshake
        from websockets.sync.client import connect as connect_websocket
    except ImportError as error:
        raise missing_extra("a DevKit of AutoDRIVE needs websockets", "autodrive") from error
    where = f"{host}:{port}"
    refused: Exception | None = None
    for revision in _REVISIONS:
        address = f"ws://{host}:{port}/socket.io/?EIO={revision}&transport=websocket"
        try:
            socket = connect_websocket(
                address, open_timeout=_HANDSHAKE, close_timeout=_CLOSING, max_size=_LONGEST, compression=None,
                proxy=None, ping_interval=None,
            ).__enter__()  # as websockets 17 wants it; its exit is `close`  # fmt: skip
        except InvalidHandshake as error:  # of another revision, or no such server
            refused = error
        except (OSError, EOFError) as error:
            said = "; start the DevKit first: it is the server, and listens on port 4567"
            raise EngineError(f"nobody answers at {where}: {error or type(error).__name__}{said}") from error
        else:
            try:
                return Client(socket, revision, where, event)
            except EngineError as error:
                socket.close()
                refused = error
    if isinstance(refused, EngineError):
        raise refused
    raise EngineError(f"{where} does not speak Socket.IO: {refused}") from refused


def _json(text: str) -> Any:
    """Return what a text of JSON has; None: it is none that can be read."""
    try:
        return parse_json(text)
    except (ValueError, RecursionError):
        return None
