"""What operators do: events, the queue, devices, gates, rollouts, keys and webhooks, on one server."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import http.server
import json
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import DISTANCE, Server, target

import lightpath

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class Receiver:
    """An address that keeps what webhooks send to it."""

    def __init__(self) -> None:
        self.received: list[tuple[bytes, dict[str, str]]] = []
        received = self.received

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["content-length"]))
                received.append((body, dict(self.headers.items())))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
        self.origin = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture(scope="module")
def receiver() -> Iterator[Receiver]:
    receiver = Receiver()
    yield receiver
    receiver.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, receiver: Receiver) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("server") / "data", "--webhook-origins", receiver.origin)
    yield server
    server.stop()


def display_with_versions(lab: lightpath.Lab, name: str, folder: Path, versions: int = 2) -> lightpath.Display:
    """A display whose kernel at 20 mm has imported versions."""
    display = lab.create_display(name, resolution="32x16", pixel_pitch="8um", wavelength="515nm")
    for i in range(versions):
        np.save(folder / "h.npy", np.full((32, 64), np.exp(1j * i), np.complex64))
        display.import_kernel(folder / "h.npy", distance=DISTANCE)
    return display


def test_the_server_tells_who_asks(lab: lightpath.Lab) -> None:
    found = lab.server()
    assert (found.token, found.role, found.displays) == ("", "admin", ())
    assert found.disk_free_bytes > found.disk_reserve_bytes
    assert abs(found.time.timestamp() - time.time()) < 60


def test_a_pause_of_the_queue_holds_the_jobs_of_a_batch(lab: lightpath.Lab) -> None:
    display = lab.create_display("paused", resolution="64x48", pixel_pitch="8um", wavelength="515nm")
    paused = lab.pause_queue(display=display, reason="laser off")
    assert [(each.display, each.reason) for each in paused.pauses] == [("displays/paused", "laser off")]
    job = display.submit_optimize(target(1)[:48, :64], distance=DISTANCE, iterations=2, batch="night")
    batch = lab.batch("night")
    assert (batch.queued, batch.done, batch.ended) == (1, 0.0, False)
    queue = lab.queue()
    assert queue.queued == sum(turn.queued for turn in queue.turns) == 1
    assert [each.kind for each in queue.processes] == ["both"]
    assert lab.resume_queue(display="paused").pauses == ()
    job.wait()
    assert lab.batch("night").succeeded == 1
    with pytest.raises(lightpath.PreconditionFailed):
        lab.resume_queue(display=display)
    pattern = job.message.result.optimize_hologram.wavelengths[0].subframes[0].pattern
    assert lab.artifact(pattern).size_bytes == len(lab.connection.download(pattern))
    with pytest.raises(lightpath.NotFound):
        lab.artifact("sha256-" + "0" * 64)


def test_events_go_on_behind_the_last_one_and_begin_anew_after_a_restart(own_server: Server) -> None:
    with lightpath.connect(own_server.url) as lab:
        events = lab.events()
        assert next(events).kind == "reset"
        lab.create_display("one", resolution="64x48", pixel_pitch="8um", wavelength="515nm")
        first = next(events)
        assert (first.kind, first.name, first.state) == ("display", "displays/one", None)
        two = lab.create_display("two", resolution="64x48", pixel_pitch="8um", wavelength="515nm")
        missed = next(lab.events(after=first))
        assert (missed.kind, missed.name) == ("display", "displays/two")
        assert next(events).id == missed.id
        job = two.submit_optimize(target(1)[:48, :64], distance=DISTANCE, iterations=2)
        ended = next(each for each in events if each.kind == "job" and each.state == "succeeded")
        assert ended.name == job.name
        own_server.kill()
        own_server.start()
        assert next(each for each in events if each.kind == "reset").id != ended.id


def test_devices_are_found_by_version_and_group(lab: lightpath.Lab, tmp_path: Path) -> None:
    display = display_with_versions(lab, "fleet", tmp_path)
    kernel = display.kernel(distance=DISTANCE)
    first, second = (kernel.version(number).message.artifact for number in (1, 2))
    display.report_device("a", kernel, version=1, format="safetensors", digest=first, self_test_loss=0.5, agent="t 1")
    display.report_device("b", "515nm-20mm", version=2, format="safetensors", digest=second)
    display.set_device_group("c", "early")
    found = display.devices()
    assert [each.id for each in found] == ["a", "b", "c"]
    used = found[0].kernels[0]
    assert (used.kernel, used.version, used.format, used.self_test_loss) == (kernel.name, 1, "safetensors", 0.5)
    assert found[0].agent == "t 1"
    assert found[0].report_time is not None
    assert found[1].kernels[0].self_test_loss is None
    assert [each.id for each in display.devices(version=2)] == ["b"]
    assert [each.id for each in display.devices(version="none")] == ["c"]
    assert [each.id for each in display.devices(kernel=kernel)] == ["a", "b"]
    assert [each.id for each in display.devices(group="early")] == ["c"]
    assert found[0].set_group("early").group == "early"
    assert [each.id for each in display.devices(group="")] == ["b"]
    found[1].delete()
    assert [each.id for each in display.devices()] == ["a", "c"]
    assert "515nm-20mm version 1" in repr(found[0])
    with pytest.raises(lightpath.InvalidRequest) as caught:
        display.report_device("a", kernel, version=1, format="safetensors")
    assert caught.value.fix


def test_a_gate_decides_which_version_becomes_active(lab: lightpath.Lab, tmp_path: Path) -> None:
    display = display_with_versions(lab, "gated", tmp_path, versions=1)
    assert display.promotion_gate().history == ()
    gate = display.set_promotion_gate(loss_reduction_min=0.05, test_pairs_min=3, formats=["npz"], reason="first")
    assert (gate.loss_reduction_min, gate.test_pairs_min, gate.formats) == (0.05, 3, ("npz",))
    assert display.promotion_gate().history[0].reason == "first"
    kernel = display.kernel(distance=DISTANCE)
    verdict = kernel.version(1).check_promotion()
    assert not verdict.passed
    assert any("3" in each for each in verdict.failures)
    with pytest.raises(lightpath.PreconditionFailed):
        kernel.promote(1)
    cleared = display.set_promotion_gate(reason="too strict")
    assert (cleared.loss_reduction_min, len(cleared.history)) == (None, 2)
    assert kernel.version(1).check_promotion().passed
    assert dict(kernel.set_alias("best", 1).message.aliases) == {"best": 1}
    assert not kernel.remove_alias("best").message.aliases
    version = kernel.version(1).deprecate("old")
    assert version.message.HasField("deprecation")
    assert not version.deprecate("new again", undo=True).message.HasField("deprecation")


def test_devices_learn_of_kernels_by_manifests(lab: lightpath.Lab, tmp_path: Path) -> None:
    display = display_with_versions(lab, "signed", tmp_path, versions=1)
    kernel = display.kernel(distance=DISTANCE).promote(1)
    manifest = kernel.manifest(format="f16")
    assert (manifest.version, manifest.expire_time.timestamp() > time.time()) == (1, True)
    assert f"digest {manifest.digest}\n" in manifest.document
    assert lab.keyring().document.startswith("lightpath keyring 1\n")
    nearest = display.nearest_kernels(distance="21mm", wavelength="515nm")
    assert ([each.name for each in nearest.kernels], nearest.can_be_interpolated) == ([kernel.name], False)
    with pytest.raises(lightpath.PreconditionFailed):
        display.interpolate_kernel(distance="21mm")


def test_a_rollout_is_widened_and_completed(lab: lightpath.Lab, tmp_path: Path) -> None:
    display = display_with_versions(lab, "rolled", tmp_path)
    kernel = display.kernel(distance=DISTANCE).promote(1)
    display.set_device_group("a", "early")
    rollout = kernel.start_rollout(2, share=0.1, group="early", reason="try")
    assert (rollout.state, rollout.from_version, rollout.group, rollout.ended) == ("running", 1, "early", False)
    assert [each.name for each in kernel.rollouts()] == [rollout.name]
    other = kernel.rollout(int(rollout.id))
    assert rollout.widen(0.5).share == 0.5
    with pytest.raises(lightpath.Aborted):
        other.widen(0.6)
    digest = kernel.version(2).message.artifact
    seen: list[tuple[int, str]] = []

    def show(state: lightpath.Rollout) -> None:
        seen.append((state.devices_passed, state.state))
        # The states come one after the other, each because of what the one before it caused.
        if state.ended:
            return
        if state.devices_passed == 0:
            display.report_device("a", kernel, version=2, format="safetensors", digest=digest)
        else:
            lab.display("rolled").kernel(distance=DISTANCE).rollout(int(rollout.id)).complete()

    assert rollout.wait(progress=show).state == "completed"
    assert seen == [(0, "running"), (1, "running"), (1, "completed")]
    assert kernel.refresh().active_version == 2
    assert len(rollout.events) == 3
    back = kernel.start_rollout(1, share=0.1)
    assert back.halt("dark images").state == "halted"
    assert "dark images" in back.events[-1].message
    assert back.wait(progress=False).ended


def test_failures_of_devices_halt_a_rollout_while_a_program_waits(lab: lightpath.Lab, tmp_path: Path) -> None:
    display = display_with_versions(lab, "failing", tmp_path)
    kernel = display.kernel(distance=DISTANCE)
    display.set_device_group("a", "early")
    rollout = kernel.start_rollout(1, share=0, group="early", failed_share_max=0, devices_min=1)

    def fail(state: lightpath.Rollout) -> None:
        if not state.ended:
            display.report_device("a", kernel, tried_version=1, message="the self-test failed")

    assert rollout.wait(progress=fail).state == "halted"
    assert rollout.devices_failed == 1


def test_the_asynchronous_client_waits_for_rollouts_and_receivers(
    server: Server, lab: lightpath.Lab, receiver: Receiver, tmp_path: Path
) -> None:
    display_with_versions(lab, "async", tmp_path, versions=1)

    async def work() -> None:
        async with lightpath.aio.connect(server.url) as other:
            kernel = await (await other.display("async")).kernel(distance=DISTANCE)
            rollout = await kernel.start_rollout(1, share=0.1)
            waiting = asyncio.create_task(rollout.wait(progress=False))
            async for event in other.events():
                if event.kind == "reset":
                    await (await kernel.rollout(int(rollout.id))).complete()
                elif event.name == kernel.name:
                    break
            assert (await waiting).state == "completed"
            webhook = await other.create_webhook("async", f"{receiver.origin}/async")
            assert (await webhook.test()).delivered
            await webhook.delete()

    asyncio.run(work())


def test_webhooks_are_created_tried_and_verified(lab: lightpath.Lab, receiver: Receiver) -> None:
    display = lab.create_display("heard", resolution="64x48", pixel_pitch="8um", wavelength="515nm")
    webhook = lab.create_webhook("ci", f"{receiver.origin}/ci", events=["job.failed"], display=display)
    assert webhook.secret.startswith("whsec_")
    assert (webhook.events, webhook.display) == (["job.failed"], "displays/heard")
    delivery = webhook.test()
    assert (delivery.type, delivery.delivered, delivery.attempts) == ("webhook.test", True, 1), delivery.answer
    body, headers = receiver.received[-1]
    event = lightpath.read_webhook(body, headers, secret=webhook.secret)
    assert (event.id, event.type, event.data) == (delivery.id, "webhook.test", delivery.data)
    with pytest.raises(lightpath.InvalidSignature):
        lightpath.read_webhook(body + b" ", headers, secret=webhook.secret)
    assert [each.id for each in webhook.deliveries()] == [delivery.id]
    assert [each.id for each in lab.webhooks()] == ["ci"]
    assert lab.webhook("ci").secret == ""
    webhook.update(events=[], display="", expected_revision=1)
    assert (webhook.events, webhook.display, webhook.url) == ([], "", f"{receiver.origin}/ci")
    with pytest.raises(lightpath.Aborted):
        webhook.update(events=["job.failed"], expected_revision=1)
    with pytest.raises(lightpath.InvalidArgument, match="what changes"):
        webhook.update()
    assert display.update(notes="heard of").notes == lab.display("heard").notes == "heard of"
    webhook.delete()
    with pytest.raises(lightpath.NotFound):
        lab.webhook("ci")
    with pytest.raises(lightpath.PreconditionFailed):
        lab.create_webhook("far", "https://elsewhere.example/")


def signed(secret: str, sent_s: float, body: dict[str, Any]) -> tuple[bytes, dict[str, str]]:
    content, sent = json.dumps(body).encode(), str(int(sent_s))
    key = base64.b64decode(secret.removeprefix("whsec_"))
    signature = base64.b64encode(hmac.digest(key, f"7.{sent}.".encode() + content, hashlib.sha256)).decode()
    return content, {"Webhook-Id": "7", "Webhook-Timestamp": sent, "Webhook-Signature": f"v1,AAAA v1,{signature}"}


def test_old_messages_and_wrong_secrets_are_refused() -> None:
    secret = "whsec_" + base64.b64encode(bytes(range(32))).decode()
    message = {"type": "job.failed", "timestamp": "2026-11-24T16:00:00.123Z", "data": {"job": "jobs/1"}}
    event = lightpath.read_webhook(*signed(secret, time.time(), message), secret=secret)
    assert (event.id, event.type, event.time.year, event.data) == ("7", "job.failed", 2026, {"job": "jobs/1"})
    with pytest.raises(lightpath.InvalidSignature, match=r"was sent 40\d s ago") as caught:
        lightpath.read_webhook(*signed(secret, time.time() - 400, message), secret=secret)
    assert caught.value.reason == "INVALID_SIGNATURE"
    for wrong in ("", "whsec_", "whsec_?", secret.removeprefix("whsec_")):
        with pytest.raises(lightpath.InvalidArgument, match="secret"):
            lightpath.read_webhook(*signed(secret, time.time(), message), secret=wrong)
    for signature in ("", "v1,", "v1,é"):
        with pytest.raises(lightpath.InvalidSignature, match="not signed"):
            lightpath.read_webhook(b"{}", {"webhook-signature": signature}, secret=secret)
