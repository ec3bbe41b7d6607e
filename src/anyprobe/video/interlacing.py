"""Turn interlaced frames, whose rows are of two moments, into whole pictures by FFmpeg's bwdif."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from anyprobe.video.pyav import pyav


class Progressive:
    """Decode packets in order: interlaced pictures are made whole, others stay as they are.

    The filter returns a picture once it has seen the next one.
    """

    def __init__(self) -> None:
        self._graph: Any = None
        self._format: tuple[Any, ...] = ()

    def __call__(self, packet: Any) -> Iterator[Any]:
        """Yield the pictures (av.VideoFrame) that are complete after a packet; an empty packet ends the stream."""
        for picture in packet.decode():
            if picture.interlaced_frame:
                form = picture.format.name, picture.width, picture.height
                if form != self._format:
                    yield from self._end()
                    self._graph, self._format = _graph(packet.stream, *form), form
                self._graph.push(picture)
                yield from self._ready()
            else:
                yield from self._end()
                yield picture
        if packet.size == 0:
            yield from self._end()

    def _ready(self) -> Iterator[Any]:
        av = pyav()
        while True:
            try:
                yield self._graph.pull()
            except (av.error.BlockingIOError, av.error.EOFError):
                return

    def _end(self) -> Iterator[Any]:
        """Yield what the filter still holds."""
        if self._graph is not None:
            self._graph.push(None)
            yield from self._ready()
        self._graph, self._format = None, ()


def _graph(stream: Any, pixels: str, width: int, height: int) -> Any:
    """Return a filter graph that makes one whole picture of each frame."""
    graph = pyav().filter.Graph()
    source = graph.add_buffer(width=width, height=height, format=pixels, time_base=stream.time_base)
    whole = graph.add("bwdif", "mode=send_frame:deint=interlaced")
    sink = graph.add("buffersink")
    source.link_to(whole)
    whole.link_to(sink)
    graph.configure()
    return graph
