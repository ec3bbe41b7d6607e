"""Metrics for Prometheus at /metrics: requests, seconds and the queue."""

from __future__ import annotations

import time
from typing import Any

from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from anyprobe.serve.pool import WorkerPool

SECONDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)
"""Upper bounds of the histogram's bins [s]."""

ELSEWHERE = "other"
"""Route label of requests without a route: clients can make up any number of addresses."""


class Metrics:
    """Metrics of one application, in its own registry, so that one process can run several."""

    def __init__(self, pool: WorkerPool, places: int) -> None:
        import prometheus_client as prometheus

        self._prometheus = prometheus
        self._registry = prometheus.CollectorRegistry()
        in_registry: dict[str, Any] = {"registry": self._registry}
        self._requests = prometheus.Counter(
            "anyprobe_requests", "Answered requests.", ["route", "status"], **in_registry
        )
        self._seconds = prometheus.Histogram(
            "anyprobe_request_seconds", "From head to last byte.", ["route"], buckets=SECONDS, **in_registry
        )
        prometheus.Gauge(
            "anyprobe_places_taken", "Requests that hold a place in the queue.", **in_registry
        ).set_function(lambda: pool.taken)
        prometheus.Gauge("anyprobe_places", "Places of the queue, those at work included.", **in_registry).set(places)
        prometheus.Gauge("anyprobe_ready", "1 where a photo would be taken now.", **in_registry).set_function(
            lambda: not pool.unready()
        )
        prometheus.ProcessCollector(**in_registry)

    def count(self, scope: Scope, status: int, seconds: float) -> None:
        """Count an answered request."""
        route = getattr(scope.get("route"), "path", ELSEWHERE)
        self._requests.labels(route, str(status)).inc()
        self._seconds.labels(route).observe(seconds)

    def answer(self) -> Response:
        """Return the metrics in Prometheus's text format."""
        text = self._prometheus.generate_latest(self._registry)
        return Response(text, media_type=self._prometheus.CONTENT_TYPE_LATEST)


class Counted:
    """Middleware that counts every request and its seconds."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app, self._metrics = app, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        start, status = time.perf_counter(), 500

        async def send_noting_status(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, send_noting_status)
        finally:
            self._metrics.count(scope, status, time.perf_counter() - start)
