"""The network side of the rosbridge server: a thread that reads what clients send and writes what waits for them."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import queue
import socket
import threading
from collections.abc import Callable
from typing import Any

from fg_mujoco.errors import SettingsError, missing_extra

from .client import Client

_MOST_UNREAD = 64  # texts of a client that wait for the race; then no more are read from it
_LARGE = 1 << 20  # letters; a larger text waits alone
_POLL = 0.005  # [s] between two looks whether one may be read
_LONGEST = 1 << 24  # bytes of a text
_OPENING = 5.0  # [s] that a client has to say what it speaks
_CLOSING = 1.0  # [s] that a client has to say goodbye


class Network:
    """Serves WebSockets to clients.

    Args:
      jobs: gets a client for each text in its inbox.
      host: address to listen on.
      port: to listen on; 0: any that is free.

    Attributes:
      port: that it listens on.

    Raises:
      SettingsError: an address that cannot be listened on.
    """

    def __init__(self, jobs: queue.SimpleQueue[Client | None], host: str, port: int) -> None:
        self._jobs, self._listening = jobs, _listen(host, port)
        self.port = int(self._listening.getsockname()[1])
        self._loop = asyncio.new_event_loop()
        self._ends = asyncio.Event()
        self._transports: set[Any] = set()  # of open connections
        self._thread = threading.Thread(target=self._run, name="rosbridge", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close all connections."""
        self._call(self._ends.set)
        self._thread.join()

    def _call(self, function: Callable[[], Any]) -> None:
        """Call a function in the network's thread, unless that has ended."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function)

    def _run(self) -> None:
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        from websockets.asyncio.server import serve

        log = logging.getLogger("fg_mujoco.rosbridge")
        log.addHandler(logging.NullHandler())
        async with serve(
            self._talk, sock=self._listening, compression=None, max_size=_LONGEST, ping_interval=None,
            max_queue=1, open_timeout=_OPENING, close_timeout=_CLOSING, logger=log,
        ):  # fmt: skip
            await self._ends.wait()
            self._loop.call_later(_CLOSING, self._abort)  # the library waits for peers that read nothing

    def _abort(self) -> None:
        for transport in self._transports:
            transport.abort()

    async def _talk(self, connection: Any) -> None:
        """Read what a client sends, as fast as the race takes it, while another task writes to it."""
        from websockets.exceptions import ConnectionClosed

        transport = connection.transport
        self._transports.add(transport)
        filled = asyncio.Event()
        host, port = connection.remote_address[:2]
        client = Client(f"{host}:{port}", lambda: self._call(filled.set), lambda: self._call(transport.abort))
        writing = asyncio.create_task(_write(client, connection, filled))
        try:
            async for text in connection:
                most = _MOST_UNREAD if len(text) < _LARGE else 1
                while len(client.inbox) >= most and not self._ends.is_set():
                    await asyncio.sleep(_POLL)
                client.inbox.append(text)
                self._jobs.put(client)
        except ConnectionClosed:
            pass
        finally:
            writing.cancel()
            self._transports.discard(transport)
            client.inbox.append(None)
            self._jobs.put(client)


async def _write(client: Client, connection: Any, filled: asyncio.Event) -> None:
    """Write what is in a client's outbox, as fast as it reads."""
    from websockets.exceptions import ConnectionClosed

    with contextlib.suppress(ConnectionClosed):
        while True:
            await filled.wait()
            filled.clear()
            while (text := client.outbox.take()) is not None:
                await connection.send(text)


def require_rosbridge() -> None:
    """Make sure that rosbridge can be served.

    Raises:
      MissingExtraError: websockets, or a part of the extra `ros`, is not installed.
    """
    from importlib.util import find_spec

    if any(find_spec(name) is None for name in ("websockets", "rosbags", "mcap", "scipy")):
        raise missing_extra("a server of rosbridge needs websockets, mcap, rosbags and SciPy", "rosbridge")


def _listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises:
      SettingsError: there cannot be one.
    """
    if not 0 <= port <= 65535:
        raise SettingsError(f"port is {port}; accepted: 1 to 65535")
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        # asyncio sends at once only on sockets that name their protocol; else a tick in lockstep would wait 40 ms
        listening = socket.socket(family, kind, socket.IPPROTO_TCP)
    except OSError as error:
        raise _not_listened_on(host, port, error) from error
    try:
        if os.name == "posix":
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen()
    except OSError as error:
        listening.close()
        raise _not_listened_on(host, port, error) from error
    return listening


def _not_listened_on(host: str, port: int, error: OSError) -> SettingsError:
    return SettingsError(
        f"{host}:{port} cannot be listened on: {error.strerror or error}; accepted: an address of this machine and a "
        "port that is free, by --port"
    )
