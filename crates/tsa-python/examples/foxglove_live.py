"""Telemetry live in Foxglove. `pip install foxglove-sdk`, start this file, then open the connection
ws://localhost:8765 in Foxglove and plot `/telemetry.position_m`.

`python3 foxglove_live.py` shows an emulated actuator that homes, and then moves up and down. With the serial device of
a board, for example `python3 foxglove_live.py /dev/ttyACM0`, it shows that board's telemetry and moves nothing.
"""

import asyncio
import sys
import time

import foxglove
import tsa_rig


async def show(rig: tsa_rig.Rig, channel: foxglove.Channel, seconds: float | None = None) -> None:
    """Sends each row, without what is not known. It has the board's time, counted from the first row's wall clock."""
    start_ns = None
    async for row in rig.stream(seconds):
        time_ns = round(1e9 * row["t_s"])
        start_ns = time.time_ns() - time_ns if start_ns is None else start_ns
        known = {name: value for name, value in row.items() if value is not None}
        channel.log(known, log_time=start_ns + time_ns)


async def up_and_down(rig: tsa_rig.Rig) -> None:
    await asyncio.to_thread(rig.home)
    while True:
        await rig.move(0.010, wait=False)
        await rig.move(0.002, wait=False)


async def main(port: str) -> None:
    server = foxglove.start_server(name="tsa_rig", host="127.0.0.1", port=8765)
    print(f"ws://localhost:{server.port}")
    with tsa_rig.Rig(port) as rig:
        shown = show(rig, foxglove.Channel("/telemetry"))
        await (asyncio.gather(shown, up_and_down(rig)) if port == "sim" else shown)


if __name__ == "__main__":
    try:
        asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "sim"))
    except KeyboardInterrupt:
        pass
