"""Uploads and downloads through a connection that is cut."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import CuttingProxy, Server

import lightpath

MIB = 1 << 20
SIZE = 20 * MIB
CUT_AFTER = 16 * MIB
# The most that both connections pass on. A transfer that starts again passes 36 MiB on. What is under way when the
# connection is cut is lost: some MiB on a busy machine, where the receiver lags behind.
PASSED_MAX = SIZE + 12 * MIB


def noise(seed: int, size: int) -> bytes:
    """Return bytes that no compression makes smaller."""
    return np.random.default_rng(seed).bytes(size)


def test_an_upload_continues_where_it_was_cut(server: Server) -> None:
    content = noise(1, SIZE)
    proxy = CuttingProxy(server, cut_after_bytes=CUT_AFTER)
    with lightpath.connect(proxy.url) as lab:
        digest = lab.connection.upload(content)
        assert proxy.cuts == 1
        assert proxy.passed_bytes < PASSED_MAX
        assert lab.connection.download(digest) == content
        before = proxy.passed_bytes
        assert lab.connection.upload(content) == digest
        assert proxy.passed_bytes - before < 10_000
    proxy.close()


def test_a_download_continues_where_it_was_cut(server: Server) -> None:
    content = noise(2, SIZE)
    with lightpath.connect(server.url) as lab:
        digest = lab.connection.upload(content)
    proxy = CuttingProxy(server, cut_after_bytes=CUT_AFTER, cut_answers=True)
    with lightpath.connect(proxy.url) as lab:
        assert lab.connection.download(digest) == content
        assert proxy.cuts == 1
        assert proxy.passed_bytes < PASSED_MAX
    proxy.close()


def test_an_unknown_digest_is_an_error_at_once(lab: lightpath.Lab) -> None:
    with pytest.raises(lightpath.NotFound):
        lab.connection.download("sha256-" + "0" * 64)
    with pytest.raises(lightpath.InvalidRequest, match="64 lower-case hexadecimal digits"):
        lab.connection.download("sha256-1")
