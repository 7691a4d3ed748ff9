"""The token of a client goes to its server only."""

from __future__ import annotations

import http.server
import threading

import pytest

from lightpath.address import address
from lightpath.errors import InvalidArgument


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


def test_the_token_goes_unencrypted_to_the_same_machine_only(monkeypatch: pytest.MonkeyPatch) -> None:
    for url in ("http://localhost:7070", "http://[::1]:7070", "https://lab:7070"):
        assert address(url, "lp_secret", None, None, None).metadata
    with pytest.raises(InvalidArgument, match="would go unencrypted to http://lab:7070: use https://"):
        address("http://lab:7070", "lp_secret", None, None, None)
    assert not address("http://lab:7070", None, None, None, None).metadata
    assert address("http://lab:7070", "lp_secret", None, None, None, token_over_http=True).metadata
    monkeypatch.setenv("LIGHTPATH_TOKEN_OVER_HTTP", "true")
    assert address("http://lab:7070", "lp_secret", None, None, None).metadata
