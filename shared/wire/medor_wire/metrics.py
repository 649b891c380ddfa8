"""Prometheus figures of one process."""

import threading
import time
from wsgiref.simple_server import WSGIServer

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, start_http_server

BUCKETS_S = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)


class Metrics:
    """Requests by endpoint and outcome, how long they took, how busy the process is, when its heart last beat."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        of = {"namespace": "medor", "registry": self.registry}
        self._requests = Counter("requests", "Requests answered", ["endpoint", "outcome"], **of)
        self._seconds = Histogram("request_seconds", "Time in the service", ["endpoint"], buckets=BUCKETS_S, **of)
        self._busy = Gauge("busy", "Requests admitted and not yet answered", **of)
        self._ready = Gauge("ready", "Whether the process can answer (1) or is still starting (0)", **of)
        self._heartbeat = Gauge("heartbeat_timestamp_seconds", "Time of the last heartbeat", **of)
        self._page: tuple[WSGIServer, threading.Thread] | None = None

    def request(self, endpoint: str, seconds: float, outcome: str) -> None:
        self._requests.labels(endpoint, outcome).inc()
        self._seconds.labels(endpoint).observe(seconds)

    def beat(self, busy: int, ready: bool) -> None:
        self._busy.set(busy)
        self._ready.set(ready)
        self._heartbeat.set(time.time())

    def serve(self, port: int) -> int:
        """Show the figures at `http://<this host>:<port>/metrics`; 0 takes a free port. Returns the port."""
        server, thread = start_http_server(port, registry=self.registry)
        self._page = (server, thread)
        return server.server_port

    def close(self) -> None:
        if self._page is not None:
            server, thread = self._page
            server.shutdown()
            server.server_close()
            thread.join()
            self._page = None
