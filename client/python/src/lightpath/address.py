"""Where the server is, and what a client shows it: token and certificates.

Arguments come first, then the variables of the environment that the program `lightpath` reads too.
"""

from __future__ import annotations

import ipaddress
import os
import ssl
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

import grpc

from lightpath.errors import InvalidArgument

DEFAULT_URL = "http://127.0.0.1:7070"

_PICTURE_TIMEOUT_S = 10.0

_OPTIONS: tuple[tuple[str, int], ...] = (
    # A page of 1000 jobs with their histories fits; the limit bounds the client's memory.
    ("grpc.max_receive_message_length", 64 << 20),
    # Watches notice within half a minute that the server's machine is gone.
    ("grpc.keepalive_time_ms", 20_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    # A restarted server is found soon. The longest pause of gRPC itself would be two minutes.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 5_000),
    ("grpc.max_reconnect_backoff_ms", 3_000),
    # A proxy for web pages does not know the way to a lab's server.
    ("grpc.enable_http_proxy", 0),
)


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    """No address of the server leads elsewhere, and the token must not go elsewhere."""

    def redirect_request(self, *_args: object, **_named: object) -> None:
        """Follow nothing: the answer is an `HTTPError`, which is an `OSError`."""


@dataclass(frozen=True)
class Address:
    """A server's address with the credentials of the client. The token is not shown."""

    url: str
    target: str
    credentials: grpc.ChannelCredentials | None = field(repr=False)
    metadata: tuple[tuple[str, str], ...] = field(repr=False)
    tls: ssl.SSLContext | None = field(repr=False)
    options: tuple[tuple[str, int], ...] = field(default=_OPTIONS, repr=False)

    def picture(self, path: str) -> bytes:
        """Return a picture that the server has over HTTP only. Raises `OSError` if there is none."""
        request = urllib.request.Request(self.url.rstrip("/") + path, headers=dict(self.metadata))  # noqa: S310
        # A proxy for web pages does not know the way to a lab's server.
        opener = urllib.request.build_opener(
            urllib.request.ProxyHandler({}), urllib.request.HTTPSHandler(context=self.tls), _NoRedirects()
        )
        with opener.open(request, timeout=_PICTURE_TIMEOUT_S) as response:
            return bytes(response.read())


def address(
    url: str | None,
    token: str | None,
    token_file: str | os.PathLike[str] | None,
    ca_file: str | os.PathLike[str] | None,
    client_certificate: tuple[str | os.PathLike[str], str | os.PathLike[str]] | None,
    *,
    token_over_http: bool | None = None,
) -> Address:
    """Return the address for the arguments of `connect`."""
    url = url or os.environ.get("LIGHTPATH_SERVER") or DEFAULT_URL
    parts = urlsplit(url if "://" in url else f"//{url}")
    try:
        port = parts.port
    except ValueError as error:
        raise InvalidArgument("url", f'is "{url}", whose port is no number', f"write it like {DEFAULT_URL}") from error
    if parts.scheme not in {"http", "https"} or not parts.netloc or parts.path not in {"", "/"}:
        fix = f"write http://{url}" if not parts.scheme else f"give an address such as {DEFAULT_URL}"
        raise InvalidArgument("url", f'is "{url}"', fix)
    default_port = "" if port else {"http": ":80", "https": ":443"}[parts.scheme]
    ca_file = ca_file or os.environ.get("LIGHTPATH_CA_FILE")
    certificate, key = client_certificate or (
        os.environ.get("LIGHTPATH_CLIENT_CERT"),
        os.environ.get("LIGHTPATH_CLIENT_KEY"),
    )
    credentials, tls = None, None
    if parts.scheme == "https":
        credentials = _credentials(ca_file, certificate, key)
        tls = ssl.create_default_context(cafile=ca_file)
        if certificate:
            tls.load_cert_chain(certificate, key)
    found = _token(token, token_file)
    is_open = parts.scheme == "http" and not _is_local(parts.hostname or "")
    if token_over_http is None:
        token_over_http = os.environ.get("LIGHTPATH_TOKEN_OVER_HTTP") == "true"
    if found is not None and is_open and not token_over_http:
        fix = "use https://, or token_over_http=True if nobody else is on the network"
        raise InvalidArgument("token", f"would go unencrypted to {url}", fix)
    metadata = (("authorization", f"Bearer {found}"),) if found is not None else ()
    return Address(url, parts.netloc + default_port, credentials, metadata, tls)


def _is_local(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _token(token: str | None, token_file: str | os.PathLike[str] | None) -> str | None:
    if token is not None and token_file is not None:
        raise InvalidArgument("token", "and token_file are both given", "give one of them")
    if token is None and token_file is None:
        token = os.environ.get("LIGHTPATH_TOKEN") or None
        token_file = os.environ.get("LIGHTPATH_TOKEN_FILE") or None
    if token is None and token_file is not None:
        token = Path(token_file).read_text(encoding="utf-8")
    if token is None:
        return None
    token = token.strip()
    if not token or not all("!" <= letter <= "~" for letter in token):
        raise InvalidArgument(
            "token",
            "is empty or has other characters than printable ASCII",
            "use a token of `lightpathd token create`",
        )
    return token


def _credentials(
    ca_file: str | os.PathLike[str] | None,
    certificate: str | os.PathLike[str] | None,
    key: str | os.PathLike[str] | None,
) -> grpc.ChannelCredentials:
    return grpc.ssl_channel_credentials(
        root_certificates=Path(ca_file).read_bytes() if ca_file else None,
        private_key=Path(key).read_bytes() if key else None,
        certificate_chain=Path(certificate).read_bytes() if certificate else None,
    )
