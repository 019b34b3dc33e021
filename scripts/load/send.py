"""Sends large bodies one after another over a few connections, at next to no cost to the machine that is measured.

wrk makes each body that differs from the one before as a new string; at 10 MB that costs more than the service does.
Here the body lies in memory once, and only the few bytes that differ are sent from elsewhere.
"""

import socket
import statistics
import threading
import time


class Load:
    """What came of it."""

    def __init__(self, service, path, content_type, body, mark, connections, seconds):
        place = body.index(mark)
        self.before, self.after, self.width = body[:place], memoryview(body)[place + len(mark) :], len(mark)
        self.port, self.seconds, self.latencies, self.failure = service.port, seconds, [], None
        self.head = (
            f"POST {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {service.key}\r\n"
            f"Content-Type: {content_type}\r\nContent-Length: {len(body)}\r\n\r\n"
        ).encode()
        threads = [threading.Thread(target=self._send, args=(number,)) for number in range(connections)]
        started = time.monotonic()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if self.failure:
            raise SystemExit(f"{path}: {self.failure}")
        self.rate = len(self.latencies) / (time.monotonic() - started)

    def percentile(self, percent):
        """Latency, milliseconds."""
        return statistics.quantiles(self.latencies, n=100, method="inclusive")[percent - 1]

    def _send(self, number):
        end = time.monotonic() + self.seconds
        count = 0
        with socket.create_connection(("127.0.0.1", self.port)) as connection:
            while time.monotonic() < end and not self.failure:
                began = time.monotonic()
                count += 1
                mark = f"{number:02d}{count:0{self.width - 2}d}".encode()
                connection.sendall(self.head + self.before + mark)
                connection.sendall(self.after)
                # The answer to an upload is small and comes as one piece.
                answer = connection.recv(1 << 16)
                if not answer.startswith(b"HTTP/1.1 202"):
                    self.failure = answer.decode(errors="replace")[:500]
                    return
                self.latencies.append((time.monotonic() - began) * 1e3)
