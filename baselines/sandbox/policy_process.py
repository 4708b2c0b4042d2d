"""The process in a sandbox that runs a policy; `confined` starts it and talks to it over two pipes."""

from __future__ import annotations

import json
import os
import resource
import sys
from typing import Any

from baselines.sandbox.channel import DONE, FAILED, MAKE, RESET, Channel, ChannelError
from baselines.sandbox.syscall_filter import install_filter

_MOST_BYTES = 256 << 20
_MOST_MESSAGE = 500
_OPEN_FILES = 256
_WAITING_SIGNALS = 64  # and timers; the kernel counts them for all processes of a user


def main() -> None:
    """Set the limits and the filter, then make the policy and answer calls until the other side is gone."""
    reading, writing, memory_bytes, time_s = sys.argv[2:]
    _limit(int(memory_bytes), float(time_s))
    install_filter()
    channel = Channel(int(reading), int(writing), _MOST_BYTES)
    server: Any = None
    try:
        channel.send(DONE, b"")
        while True:
            kind, payload = channel.receive()
            try:
                if kind == MAKE:
                    server = _make(json.loads(payload))
                    answer = b""
                else:
                    answer = server.reset(json.loads(payload)) if kind == RESET else server.act(payload)
            except Exception as error:
                message = f"{type(error).__name__}: {error}"[:_MOST_MESSAGE]
                channel.send(FAILED, message.encode(errors="replace"))
            else:
                channel.send(DONE, answer)
    except ChannelError:
        os._exit(0)


def _limit(memory_bytes: int, time_s: float) -> None:
    """Set limits that nothing here can raise again: this process has no capabilities."""
    limits = {
        resource.RLIMIT_AS: memory_bytes,
        resource.RLIMIT_CPU: int(time_s) + 1,
        resource.RLIMIT_FSIZE: 0,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NOFILE: _OPEN_FILES,
        resource.RLIMIT_SIGPENDING: _WAITING_SIGNALS,
    }
    for kind, most in limits.items():
        hard = resource.getrlimit(kind)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (most, most))


def _make(asked: dict[str, Any]) -> Any:
    """Return what answers the calls; it is imported now, within the limits."""
    from baselines.sandbox.policy_server import PolicyServer

    return PolicyServer(**asked)
