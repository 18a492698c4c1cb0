"""A client of Socket.IO, as far as a simulator needs it that talks to a DevKit: events by WebSocket, one namespace.

    with connect("127.0.0.1", 4567) as client:
        client.send("Bridge", {"V1 Throttle": "0.0"})
        data = client.receive("Bridge", timeout=10.0)

DevKits of the league have python-socketio 4, which speaks revision 3 of Engine.IO; newer ones speak revision 4. No one
library speaks both, so this module does. Source: the published protocols of Engine.IO and Socket.IO. It needs the extra
`autodrive`.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator
from typing import Any

from ...errors import EngineError, missing_extra

_OPEN, _CLOSE, _PING, _PONG, _MESSAGE = "0", "1", "2", "3", "4"  # of Engine.IO
_CONNECT, _DISCONNECT, _EVENT, _REFUSED = "0", "1", "2", "4"  # of Socket.IO, within a message
_REVISIONS = (4, 3)
_HANDSHAKE = 5.0  # [s]
_LONGEST = 1 << 22  # bytes of a message


class Client:
    """An open connection.

    Args:
      socket: of `websockets.sync.client`.
      revision: of Engine.IO.
      where: host and port, for messages.
    """

    def __init__(self, socket: Any, revision: int, where: str) -> None:
        self.where, self._socket, self._revision = where, socket, revision
        self._ping_every, self._last_ping = 25.0, time.monotonic()  # [s]
        self._shake_hands()

    def send(self, event: str, data: Any) -> None:
        """Send an event.

        Raises:
          EngineError: the connection is closed.
        """
        self._keep_alive()
        self._write(_MESSAGE + _EVENT + json.dumps([event, data], separators=(",", ":")))

    def receive(self, event: str, timeout: float) -> Any:
        """Return the data of the next event of a name; others are passed over.

        Args:
          event: its name.
          timeout: for which to wait [s].

        Raises:
          TimeoutError: there was none.
          EngineError: the connection is closed.
        """
        until = time.monotonic() + timeout
        while True:
            self._keep_alive()
            found = self._event(self._read(until))
            if found is not None and found[:1] == [event]:
                return found[1] if len(found) > 1 else None

    def close(self) -> None:
        """Close the connection."""
        with contextlib.suppress(EngineError):
            self._write(_MESSAGE + _DISCONNECT)
        self._socket.close()

    def _shake_hands(self) -> None:
        until = time.monotonic() + _HANDSHAKE
        try:
            opened = self._read(until)
            settings = json.loads(opened[1:]) if opened[:1] == _OPEN else None
            if not isinstance(settings, dict):
                raise EngineError(f"{self.where} does not speak Socket.IO: it began with {opened[:40]!r}")
            self._ping_every = float(settings.get("pingInterval", 25_000)) / 1000.0
            if self._revision > 3:  # before that, the server connects by itself
                self._write(_MESSAGE + _CONNECT)
            while not (answer := self._read(until)).startswith(_MESSAGE + _CONNECT):
                if answer.startswith(_MESSAGE + _REFUSED):
                    raise EngineError(f"{self.where} refuses the connection: {answer[2:80]}")
        except (TimeoutError, ValueError) as error:
            raise EngineError(f"{self.where} does not speak Socket.IO: no handshake within {_HANDSHAKE:g} s") from error

    def _event(self, packet: str) -> list[Any] | None:
        """Return name and data of a packet's event, having answered what asks for an answer; None: it is none."""
        if packet[:1] == _PING:
            self._write(_PONG + packet[1:])
        elif packet[:1] == _CLOSE or packet[:2] == _MESSAGE + _DISCONNECT:
            raise EngineError(f"{self.where} has closed the connection")
        elif packet[:2] == _MESSAGE + _EVENT:
            with contextlib.suppress(ValueError):
                found = json.loads(packet[2:].lstrip("0123456789"))  # an id, if an acknowledgement is asked for
                return found if isinstance(found, list) else None
        return None

    def _keep_alive(self) -> None:
        """Ping the server where that is the client's part: in revision 3."""
        now = time.monotonic()
        if self._revision == 3 and now - self._last_ping >= self._ping_every:
            self._last_ping = now
            self._write(_PING)

    def _write(self, packet: str) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            self._socket.send(packet)
        except (ConnectionClosed, OSError) as error:
            raise EngineError(f"{self.where} has closed the connection") from error

    def _read(self, until: float) -> str:
        from websockets.exceptions import ConnectionClosed

        try:
            packet = self._socket.recv(timeout=max(until - time.monotonic(), 0.0))
        except (ConnectionClosed, OSError) as error:
            if isinstance(error, TimeoutError):
                raise
            raise EngineError(f"{self.where} has closed the connection") from error
        return packet if isinstance(packet, str) else ""  # bytes belong to binary events, which DevKits do not send


@contextlib.contextmanager
def connect(host: str, port: int) -> Iterator[Client]:
    """Connect to a server of Socket.IO, and close the connection at the end.

    Raises:
      EngineError: nobody listens there, or somebody who does not speak it.
      MissingExtraError: the extra `autodrive` is not installed.
    """
    client = open_client(host, port)
    try:
        yield client
    finally:
        client.close()


def open_client(host: str, port: int) -> Client:
    """Return a new connection; errors as those of `connect`."""
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
                address, open_timeout=_HANDSHAKE, max_size=_LONGEST, compression=None, proxy=None, ping_interval=None
            )
        except InvalidHandshake as error:  # of another revision, or no such server
            refused = error
        except (OSError, EOFError) as error:
            said = "; start the DevKit first: it is the server, and listens on port 4567"
            raise EngineError(f"nobody answers at {where}: {error or type(error).__name__}{said}") from error
        else:
            try:
                return Client(socket, revision, where)
            except EngineError as error:
                socket.close()
                refused = error
    if isinstance(refused, EngineError):
        raise refused
    raise EngineError(f"{where} does not speak Socket.IO: {refused}") from refused
