"""What a command shows on a pseudo-terminal."""

import os


def read_to_the_end(terminal):
    """Return all that is written to the other end until it is closed, and close this one."""
    shown = b""
    while True:
        try:
            piece = os.read(terminal, 4096)
        except OSError:  # how Linux says that the other end is closed
            break
        if not piece:
            break
        shown += piece
    os.close(terminal)
    return shown
