"""Launches that follow each other in the same order every time: on a CUDA device they are recorded once as a graph."""

from collections.abc import Callable
from typing import Any

import warp as wp


class Replayed:
    """A function that launches kernels on fixed arrays, and reads nothing back.

    Its first call launches them one by one, which compiles them. On a CUDA device the second call records them; it and
    all later calls launch the record. Work is queued on torch's current stream, so tensors need no other order.
    """

    def __init__(self, device: Any, launch: Callable[[], None]) -> None:
        """Take the function."""
        self._device, self._launch, self._graph, self._compiled = device, launch, None, False

    def __call__(self) -> None:
        """Queue the launches."""
        if not self._device.is_cuda:
            with wp.ScopedDevice(self._device):
                self._launch()
            return
        import torch

        stream = wp.stream_from_torch(torch.cuda.current_stream(torch.device(str(self._device))))
        if not self._compiled:
            with wp.ScopedDevice(self._device), wp.ScopedStream(stream):
                self._launch()
            self._compiled = True
            return
        if self._graph is None:
            with wp.ScopedDevice(self._device), wp.ScopedCapture(self._device) as record:
                self._launch()
            self._graph = record.graph
        wp.capture_launch(self._graph, stream=stream)
