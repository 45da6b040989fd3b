"""The live view of `examples/foxglove_live.py`, seen by a client of its WebSocket."""

import asyncio
import json
import os
import runpy
import struct
import time
from pathlib import Path
from typing import Any

import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = os.environ.get("TSA_PROGRAMS")
foxglove = pytest.importorskip("foxglove", reason="it is not installed: pip install foxglove-sdk", exc_type=ImportError)
client = pytest.importorskip("websockets.asyncio.client", reason="it is not installed: pip install websockets")
LONGEST_S = 60.0


async def subscribed(socket: Any) -> None:
    """Subscribes to the topic once the server advertises it."""
    async for text in socket:
        for channel in json.loads(text).get("channels", []):
            assert channel["topic"] == "/telemetry" and channel["encoding"] == "json"
            await socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}))
            return


async def two_messages(socket: Any) -> list[tuple[int, dict[str, Any]]]:
    """The times (ns) and the contents of the next two messages."""
    found = []
    async for data in socket:
        if isinstance(data, bytes) and data[0] == 1:
            subscription, time_ns = struct.unpack_from("<IQ", data, 1)
            assert subscription == 7
            found.append((time_ns, json.loads(data[13:])))
        if len(found) == 2:
            break
    return found


def test_a_client_on_loopback_receives_the_position() -> None:
    show = runpy.run_path(str(ROOT / "crates/tsa-python/examples/foxglove_live.py"), run_name="example")["show"]

    async def main() -> None:
        context = foxglove.Context()
        server = foxglove.start_server(host="127.0.0.1", port=0, context=context)
        channel = foxglove.Channel("/telemetry", context=context)
        scene, plant = ROOT / "scenes/default.toml", {"load": "0.5kg"}
        with tsa_rig.Rig("sim", scene=scene, plant=plant, programs=PROGRAMS) as rig:
            await asyncio.to_thread(rig.home)
            url = f"ws://127.0.0.1:{server.port}"
            async with client.connect(url, subprotocols=["foxglove.sdk.v1"], max_queue=None) as socket:
                await subscribed(socket)
                while not channel.has_sinks():
                    await asyncio.sleep(0.01)
                _, told = await asyncio.gather(show(rig, channel, 0.5), two_messages(socket))
                (first_ns, first), (second_ns, second) = told
        server.stop()
        assert first["position_m"] == pytest.approx(rig.telemetry()["position_m"][-1], abs=1e-4)
        assert first["state"] == "ready" and "fault" not in first, "what is not known is left out"
        assert (second_ns - first_ns) / 1e9 == pytest.approx(second["t_s"] - first["t_s"], abs=1e-6)
        assert abs(first_ns / 1e9 - time.time()) < 3600.0, "the wall clock"

    asyncio.run(asyncio.wait_for(main(), LONGEST_S))
