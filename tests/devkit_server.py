"""A DevKit for tests: a server of Socket.IO by WebSocket, written from the protocol, whose answers a function makes."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

Answer = Callable[[int, dict[str, str]], Any]
"""Of the number of a packet, from 0, and the packet: the data of the answer, SILENT, or GONE."""

SILENT, GONE = "silent", "gone"


class DevKitServer:
    """What it was sent, and what it is asked for.

    Args:
      answer: makes the answers.
      revision: of Engine.IO that it speaks; another is refused.
    """

    def __init__(self, answer: Answer, revision: int) -> None:
        self.packets: list[dict[str, str]] = []
        self._answer, self._revision = answer, revision

    def refuse(self, connection: ServerConnection, request: Any) -> Any:
        """Answer as python-socketio does: a client of another revision gets a status of 400."""
        asked = parse_qs(urlsplit(request.path).query).get("EIO")
        return None if asked == [str(self._revision)] else connection.respond(400, "unsupported version")

    def talk(self, connection: ServerConnection) -> None:
        """Shake hands, and answer each packet."""
        connection.send('0{"sid":"a","upgrades":[],"pingInterval":25000,"pingTimeout":20000}')
        if self._revision == 4:
            assert connection.recv() == "40"
            connection.send('40{"sid":"b"}')
        else:
            connection.send("40")
        connection.send('42["Other",{"not":"for us"}]')
        try:
            while True:
                message = str(connection.recv())
                if message == "2":
                    connection.send("3")
                if not message.startswith("42"):
                    continue
                if self._revision == 4 and len(self.packets) % 7 == 0:
                    connection.send("2")  # a ping, which the client is to answer
                event, packet = json.loads(message[2:])
                assert event == "Bridge"
                answer = self._answer(len(self.packets), packet)
                self.packets.append(packet)
                if answer == GONE:
                    return
                if answer != SILENT:
                    connection.send("42" + json.dumps(["Bridge", answer]))
        except ConnectionClosed:
            pass


@contextmanager
def devkit_server(answer: Answer, revision: int = 3) -> Iterator[tuple[str, DevKitServer]]:
    """Run a DevKit, and yield its address and itself."""
    kit = DevKitServer(answer, revision)
    with serve(kit.talk, "127.0.0.1", 0, process_request=kit.refuse, compression=None, max_size=1 << 22) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.socket.getsockname()[1]}", kit
        server.shutdown()
        thread.join()


def commands(throttle: float = 0.1, steering: float = 0.0, **more: str) -> dict[str, str]:
    """Return an answer as DevKits write it."""
    return {"V1 Throttle": f"{throttle:.3f}", "V1 Steering": f"{steering:.3f}", **more}
