"""A DevKit for tests: a server of Socket.IO by WebSocket, written from the protocol, whose answers a function makes."""

import json
import threading
import time
from contextlib import contextmanager, suppress
from urllib.parse import parse_qs, urlsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

SILENT, GONE = "silent", "gone"
PING, PATIENCE = 0.2, 1.5  # [s] between pings, and without a sign of life until the client is dropped


class DevKitServer:
    """What it was sent, and what it is asked for.

    Args:
      answer: makes, of the number of a packet from 0 and the packet, the data of the answer, SILENT, GONE, or a list of
        several answers and the time [s] after which each is sent. A KeyError is one of the DevKit's handler, which
        python-socketio survives.
      revision: of Engine.IO that it speaks; another is refused.
    """

    def __init__(self, answer, revision):
        self.packets = []
        self._answer, self._revision = answer, revision

    def refuse(self, connection, request):
        """Answer as python-engineio does: one of revision 4 refuses other clients, one of revision 3 refuses nobody."""
        if self._revision == 3:
            return None
        asked = parse_qs(urlsplit(request.path).query).get("EIO")
        return None if asked == [str(self._revision)] else connection.respond(400, "unsupported version")

    def talk(self, connection):
        """Shake hands, and answer each packet."""
        interval = int(1000 * PING)
        connection.send(f'0{{"sid":"a","upgrades":[],"pingInterval":{interval},"pingTimeout":20000}}')
        if self._revision == 4:
            assert connection.recv() == "40"
            connection.send('40{"sid":"b"}')
        else:
            connection.send("40")
        connection.send('42["Other",{"not":"for us"}]')
        connection.send("42" + "[" * 50_000)
        alive = pinged = time.monotonic()
        try:
            while time.monotonic() - alive < PATIENCE:
                if self._revision == 4 and time.monotonic() - pinged > PING:
                    connection.send("2")
                    pinged = time.monotonic()
                try:
                    message = str(connection.recv(timeout=PING))
                except TimeoutError:
                    continue
                if message == ("2" if self._revision == 3 else "3"):
                    alive = time.monotonic()
                if message == "2":
                    connection.send("3")
                if message.startswith("42") and not self._take(connection, message):
                    return
        except ConnectionClosed:
            pass

    def _take(self, connection, message):
        """Answer a packet; return whether the connection stays."""
        event, packet = json.loads(message[2:])
        assert event == "Bridge"
        self.packets.append(packet)
        try:
            answer = self._answer(len(self.packets) - 1, packet)
        except KeyError:
            return True
        for delay, each in answer if isinstance(answer, list) else [(0.0, answer)]:
            if each not in (SILENT, GONE):
                arguments = connection, "42" + json.dumps(["Bridge", each])
                threading.Timer(delay, _send, arguments).start() if delay else _send(*arguments)
        return answer != GONE


def _send(connection, text):
    with suppress(ConnectionClosed):
        connection.send(text)


@contextmanager
def devkit_server(answer, revision=3):
    """Run a DevKit, and yield its address and itself."""
    kit = DevKitServer(answer, revision)
    with serve(kit.talk, "127.0.0.1", 0, process_request=kit.refuse, compression=None, max_size=1 << 22) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.socket.getsockname()[1]}", kit
        server.shutdown()
        thread.join()


def commands(throttle=0.1, steering=0.0, **more):
    """Return an answer as DevKits write it."""
    return {"V1 Throttle": f"{throttle:.3f}", "V1 Steering": f"{steering:.3f}", **more}
