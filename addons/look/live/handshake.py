"""Who may talk to the live view: the page that it served itself, and no other page that a browser has open.

A page of another site can open a WebSocket to this machine, or reach it by a name of its own that it points here (DNS
rebinding). A browser says in `Origin` whose page asks, and in `Host` by which name. So a request is answered only if
its `Host` is an address, `localhost`, this machine's name or the name that is listened on, and its `Origin`, if it has
one, is that `Host`. A program that is no browser can write any header: it is kept out by the address that is listened
on.
"""

from __future__ import annotations

import functools
import http
import ipaddress
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit


def is_own(hosts: list[str], origins: list[str], names: frozenset[str]) -> bool:
    """Return whether a request, by its headers, comes from a page of this server, of one of `names`, or from none."""
    if len(hosts) != 1 or len(origins) > 1:
        return False
    (host,) = hosts
    if origins and origins[0].lower() != f"http://{host.lower()}":
        return False
    try:
        called = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    return called in names | {"localhost"} or _is_address(called)


@contextmanager
def own_pages_only(host: str) -> Iterator[list[str]]:
    """Let a server of viser that is started meanwhile, listening on `host`, answer `is_own` requests alone.

    viser has no setting for it, so what it starts its server with is wrapped. Yield what was guarded so, in the end the
    one server. If there is none, this version of viser starts its server otherwise, and is not to be used.
    """
    import websockets.asyncio.server as library

    names, serve = frozenset({host.lower(), socket.gethostname().lower()}), library.serve
    guarded: list[str] = []

    @functools.wraps(serve, updated=())
    def guarded_serve(*arguments: Any, process_request: Any = None, **settings: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            headers = request.headers
            if not is_own(headers.get_all("Host"), headers.get_all("Origin"), names):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "This page may not use the live view.\n")
            return None if process_request is None else process_request(connection, request)

        guarded.append(host)
        return serve(*arguments, process_request=check, **{"logger": _log(), **settings})

    library.serve = guarded_serve  # type: ignore[assignment, misc]
    try:
        yield guarded
    finally:
        library.serve = serve  # type: ignore[misc]


def _log() -> logging.Logger:
    """Return the logger for requests that are none: silent, unless Python's logging is set up."""
    logger = logging.getLogger("fg_mujoco.live")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    return logger


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
