"""The token of a client goes to its server only."""

from __future__ import annotations

import http.server
import threading

import pytest

from lightpath.address import address


def test_the_token_does_not_follow_a_redirect() -> None:
    seen: list[str | None] = []

    class Elsewhere(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            seen.append(self.headers["authorization"])
            self.send_response(200)
            self.end_headers()

    elsewhere = http.server.HTTPServer(("127.0.0.1", 0), Elsewhere)

    class Redirecting(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(302)
            self.send_header("location", f"http://localhost:{elsewhere.server_port}/")
            self.end_headers()

    redirecting = http.server.HTTPServer(("127.0.0.1", 0), Redirecting)
    for server in (elsewhere, redirecting):
        threading.Thread(target=server.serve_forever, daemon=True).start()
    found = address(f"http://127.0.0.1:{redirecting.server_port}", "lp_secret", None, None, None)
    try:
        with pytest.raises(OSError, match="302"):
            found.picture("/v1/jobs/1/picture")
    finally:
        for server in (elsewhere, redirecting):
            server.shutdown()
            server.server_close()
    assert seen == []
