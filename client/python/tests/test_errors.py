"""Refusals carry field, reason and fix; tokens decide who may do what."""

from __future__ import annotations

import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import DISTANCE, Server, program, target

import lightpath
from lightpath.errors import Exhausted, InvalidArgument, LightpathError, ServerStatus, Unreachable
from lightpath.retry import Backoff

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def test_refusals_carry_field_reason_and_fix(bench: lightpath.Display) -> None:
    with pytest.raises(lightpath.InvalidRequest, match="is 20000, but must be 1 to 10000") as caught:
        bench.optimize(target(1), distance=DISTANCE, iterations=20_000)
    error = caught.value
    assert isinstance(error, ValueError)
    assert error.field == "iterations"
    assert "spec." not in str(error)
    with pytest.raises(lightpath.InvalidRequest, match="distance") as caught:
        bench.optimize(target(1), distance=["20mm", "20mm"], iterations=2)
    assert caught.value.field == "distance[1]"
    with pytest.raises(lightpath.InvalidRequest) as caught:
        bench.optimize(target(1), distance="20mm", region=(0, 0, 500, 10))
    assert caught.value.field == "region"
    with pytest.raises(lightpath.InvalidRequest) as caught:
        bench.optimize(target(1), distance="20mm", wavelength="600nm")
    assert caught.value.field == "wavelength"
    assert error.reason == "INVALID_FIELD"
    assert error.fix == "must be 1 to 10000"
    assert error.code == "INVALID_ARGUMENT"
    assert [each.field for each in error.fields] == [error.field]


def test_missing_things_are_lookup_errors(lab: lightpath.Lab, bench: lightpath.Display) -> None:
    with pytest.raises(LookupError, match="displays/none does not exist") as caught:
        lab.display("none")
    assert isinstance(caught.value, lightpath.NotFound)
    assert caught.value.field == "displays/none"
    assert caught.value.fix
    with pytest.raises(lightpath.MissingKernel, match="has no kernel there: learn one") as nowhere:
        bench.kernel(distance="30mm")
    assert isinstance(nowhere.value, LookupError)


def test_targets_that_are_no_pictures_are_refused_by_the_server(bench: lightpath.Display, tmp_path: Path) -> None:
    (tmp_path / "target.png").write_bytes(b"no picture")
    with pytest.raises(lightpath.InvalidRequest) as caught:
        bench.optimize(tmp_path / "target.png", distance=DISTANCE)
    assert "target" in caught.value.field
    with pytest.raises(lightpath.InvalidRequest, match="8"):
        bench.optimize(np.zeros((4, 4), np.uint8), distance=DISTANCE)
    with pytest.raises(lightpath.InvalidArgument, match="2 pictures for 3 distances"):
        bench.optimize([target(1), target(2)], distance=["10mm", "20mm", "30mm"])


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, dict[str, str]]]:
    """A server that requires tokens, with a token for each of two roles."""
    folder = tmp_path_factory.mktemp("guarded") / "data"
    tokens = {}
    for role in ("viewer", "admin"):
        command = [program("lightpathd"), "token", "create", f"{role}-1", "--role", role, "--data-dir", str(folder)]
        tokens[role] = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    server = Server(folder, "--require-tokens")
    yield server, tokens
    server.stop()


def test_viewers_may_look_and_not_change(guarded: tuple[Server, dict[str, str]]) -> None:
    server, tokens = guarded
    with lightpath.connect(server.url, token=tokens["viewer"]) as lab:
        assert lab.displays() == []
        with pytest.raises(PermissionError, match="viewer") as caught:
            lab.create_display("bench", resolution="160x96", pixel_pitch="8um", wavelength="515nm")
    assert isinstance(caught.value, lightpath.NotAllowed)
    assert caught.value.reason == "PERMISSION_DENIED"
    assert caught.value.fix
    assert tokens["viewer"] not in repr(lab.connection.address)


def test_tokens_come_from_arguments_files_and_the_environment(
    guarded: tuple[Server, dict[str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, tokens = guarded
    with lightpath.connect(server.url) as lab, pytest.raises(lightpath.NotAllowed, match="token") as caught:
        lab.displays()
    assert caught.value.reason == "UNAUTHENTICATED"
    (tmp_path / "token").write_text(tokens["admin"] + "\n")
    with lightpath.connect(server.url, token_file=tmp_path / "token") as lab:
        assert lab.displays() == []
    monkeypatch.setenv("LIGHTPATH_SERVER", server.url)
    monkeypatch.setenv("LIGHTPATH_TOKEN_FILE", str(tmp_path / "token"))
    with lightpath.connect() as lab:
        assert lab.displays() == []
    monkeypatch.setenv("LIGHTPATH_TOKEN", tokens["viewer"])
    with lightpath.connect() as lab, pytest.raises(PermissionError):
        lab.create_display("bench", resolution="160x96", pixel_pitch="8um", wavelength="515nm")


@pytest.mark.parametrize(
    ("url", "fix"),
    [
        ("127.0.0.1:7070", "write http://127.0.0.1:7070"),
        ("ftp://lab", "such as http://127.0.0.1:7070"),
        ("http://", "such as http://127.0.0.1:7070"),
        ("http://127.0.0.1:7070x", "whose port is no number"),
    ],
)
def test_bad_addresses_are_refused_before_connecting(url: str, fix: str) -> None:
    with pytest.raises(InvalidArgument, match=fix) as caught:
        lightpath.connect(url)
    assert caught.value.field == "url"


def test_unknown_authorities_are_named_as_the_cause() -> None:
    refused = Unreachable("https://lab:7070", "CERTIFICATE_VERIFY_FAILED: self signed certificate")
    assert "ca_file" in refused.fix
    assert refused.fix in str(refused)
    assert "lightpathd serve" in Unreachable("http://lab:7070", "connection refused").fix


def test_bad_tokens_are_refused_and_not_shown() -> None:
    for token in ("", " ", "two words", "ümlaut"):
        with pytest.raises(InvalidArgument, match="printable ASCII"):
            lightpath.connect(token=token)
    with pytest.raises(InvalidArgument, match="give one of them"):
        lightpath.connect(token="a", token_file="b")


def exhausted(retry_after_s: float | None) -> LightpathError:
    return Exhausted(ServerStatus("RESOURCE_EXHAUSTED", "the queue is full", "QUEUE_FULL", retry_after_s=retry_after_s))


def test_pauses_follow_the_table() -> None:
    backoff, away = Backoff(), Unreachable("http://lab", "away")
    pauses_s = [backoff.pause_s(away) for _ in range(9)]
    assert pauses_s[:3] == [0.1, 0.2, 0.4]
    assert max(pauses_s) == 3.0
    assert 10 < sum(pauses_s) < 20
    with pytest.raises(Unreachable):
        backoff.pause_s(away)
    backoff.reset()
    assert backoff.pause_s(away) == 0.1
    assert Backoff().pause_s(exhausted(5.0)) == 5.0
    for error in (exhausted(60.0), exhausted(None), InvalidArgument("distance", "is 0", "give another")):
        with pytest.raises(type(error)):
            Backoff().pause_s(error)
    with pytest.raises(Unreachable):
        Backoff(1).pause_s(away)


def test_all_wrong_fields_are_named_at_once(bench: lightpath.Display) -> None:
    with pytest.raises(lightpath.InvalidRequest) as caught:
        bench.optimize(target(1), distance=DISTANCE, iterations=20_000, subframes=99, batch="x" * 200)
    error = caught.value
    fields = ["batch", "iterations", "subframes"]
    assert [each.field for each in error.fields] == fields
    assert error.fields[1].path == "spec.optimize_hologram.iterations"
    lines = str(error).splitlines()
    assert lines[0] == "3 fields of the request are wrong: (INVALID_FIELD)"
    assert [line.split()[0] for line in lines[1:]] == fields
    assert error.fix.splitlines()[1:] == [
        "iterations: must be 1 to 10000",
        "subframes: must be 1 to 24",
    ]
    assert [each.problem for each in error.fields] == ["has 200 bytes", "is 20000", "is 99"]


def test_phase_responses_in_another_unit_are_questioned(lab: lightpath.Lab) -> None:
    def create(phases: object) -> None:
        lab.create_display(
            "measured",
            resolution="160x96",
            pixel_pitch="8um",
            wavelength="515nm",
            phase_response_rad=phases,  # type: ignore[arg-type]
        )

    with pytest.raises(lightpath.InvalidRequest, match=r"spans 360 rad, 57 turns.* are these degrees"):
        create(np.linspace(0, 360, 256))
    with pytest.raises(lightpath.InvalidRequest, match=r"whole numbers only.* are they grey levels"):
        create(list(range(256)))
    with pytest.raises(lightpath.InvalidArgument, match="has the shape"):
        create(np.zeros((256, 2)))
    create(np.linspace(0, 2.9 * np.pi, 256))
