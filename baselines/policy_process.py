"""The process that a confined policy runs in; `baselines.confined` starts it and talks to it over two pipes."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from baselines.channel import DONE, FAILED, MAKE, RESET, Channel, ChannelError
from baselines.confinement import Limits, confine

_MOST_BYTES = 256 << 20
_MOST_SAID = 500


def main() -> None:
    """Confine this process, then make the policy and answer calls until the other side is gone."""
    reading, writing, memory_bytes, time_s = sys.argv[2:]
    held = confine(Limits(int(memory_bytes), float(time_s)))
    sys.path.append(str(Path.cwd()))  # where a policy given as module:Class lies
    channel = Channel(int(reading), int(writing), _MOST_BYTES)
    server: Any = None
    try:
        channel.send(DONE, json.dumps(vars(held)).encode())
        while True:
            kind, payload = channel.receive()
            try:
                if kind == MAKE:
                    server = _make(json.loads(payload))
                    answer = server.sha256.encode()
                else:
                    answer = server.reset(json.loads(payload)) if kind == RESET else server.act(payload)
            except Exception as error:
                said = f"{type(error).__name__}: {error}"[:_MOST_SAID]
                channel.send(FAILED, said.encode(errors="replace"))
            else:
                channel.send(DONE, answer)
    except ChannelError:
        os._exit(0)


def _make(asked: dict[str, Any]) -> Any:
    """Return what answers the calls; it is imported now, as it starts threads."""
    from baselines.policy_server import PolicyServer

    return PolicyServer(**asked)
