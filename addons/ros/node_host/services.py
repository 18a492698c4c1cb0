"""Services: requests go to who offers them, as messages do, and are answered in that node's turn.

A service is a subscription to a topic that no node can name. So requests are answered by the executors of the node
that offers it, in the order in which its messages and requests have come. The host itself answers at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .graph import Graph, Subscription
from .node_session import Session

_TOPIC = "service "  # before the name: no name of a topic has a space

Answer = Callable[[Any], Any]
"""Returns the response to a request."""


class Call:
    """A request on its way to who answers it; `done` is called with the response."""

    def __init__(self, request: Any, done: Callable[[Any], Any]) -> None:
        self.request, self.done = request, done


def offer(session: Session, name: str, answer: Answer, node: str) -> Subscription:
    """Offer a service, by its full name; return what it is listened to with."""
    graph = session.graph
    listens = Subscription(
        _TOPIC + name, Call, lambda call: call.done(answer(call.request)), 1000, node, graph.place()
    )  # fmt: skip
    graph.subscriptions.append(listens)
    return listens


def offered(graph: Graph, name: str) -> bool:
    """Return whether anybody offers a service."""
    return name in graph.answers or graph.listens(_TOPIC + name)


def ask(graph: Graph, name: str, request: Any, done: Callable[[Any], Any]) -> None:
    """Send a request; `done` gets the response. Nothing happens where nobody offers the service."""
    if name in graph.answers:
        done(graph.answers[name](request))
        return
    for each in graph.subscriptions:
        if each.topic == _TOPIC + name:
            graph.queue(each, Call(request, done))
            return


def wait_for(session: Session, name: str, until: int | None) -> bool:
    """Wait until a service is offered, or for a simulated time [ns]; return whether it is."""
    graph = session.graph
    if not offered(graph, name):
        session.waits = f"the service {name}, which nobody offers{graph.place()}"
        graph.pause(until, lambda: offered(graph, name))
    if offered(graph, name):
        session.waits = ""
        return True
    return False
