"""Uploads and downloads through a connection that is cut."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import CuttingProxy, Server

import lightpath

MIB = 1 << 20


def noise(seed: int, size: int) -> bytes:
    """Return bytes that no compression makes smaller."""
    return np.random.default_rng(seed).bytes(size)


def test_an_upload_continues_where_it_was_cut(server: Server) -> None:
    content = noise(1, 12 * MIB)
    proxy = CuttingProxy(server, cut_after_bytes=8 * MIB)
    with lightpath.connect(proxy.url) as lab:
        digest = lab.connection.upload(content)
        assert proxy.cuts == 1
        # The first connection passed less than 8 MiB on, and the server kept whole chunks of them.
        assert proxy.passed_bytes < len(content) + 4 * MIB
        assert lab.connection.download(digest) == content
        before = proxy.passed_bytes
        assert lab.connection.upload(content) == digest
        assert proxy.passed_bytes - before < 10_000
    proxy.close()


def test_a_download_continues_where_it_was_cut(server: Server) -> None:
    content = noise(2, 12 * MIB)
    with lightpath.connect(server.url) as lab:
        digest = lab.connection.upload(content)
    proxy = CuttingProxy(server, cut_after_bytes=8 * MIB, cut_answers=True)
    with lightpath.connect(proxy.url) as lab:
        assert lab.connection.download(digest) == content
        assert proxy.cuts == 1
        assert proxy.passed_bytes < len(content) + 4 * MIB
    proxy.close()


def test_an_unknown_digest_is_an_error_at_once(lab: lightpath.Lab) -> None:
    with pytest.raises(lightpath.NotFound):
        lab.connection.download("sha256-" + "0" * 64)
    with pytest.raises(lightpath.InvalidRequest, match="64 lower-case hexadecimal digits"):
        lab.connection.download("sha256-1")
