"""Rigs under asyncio."""

import asyncio
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = os.environ.get("TSA_PROGRAMS")


def emulated(seed: int) -> tsa_rig.Rig:
    scene = ROOT / "scenes" / "default.toml"
    return tsa_rig.Rig("sim", scene=scene, seed=seed, plant={"load": "0.5kg"}, programs=PROGRAMS)


def test_two_rigs_move_at_the_same_time_while_other_tasks_go_on() -> None:
    async def main() -> None:
        with emulated(1) as one, emulated(2) as other:
            await asyncio.gather(asyncio.to_thread(one.home), asyncio.to_thread(other.home))
            motions = [rig.move(to_m, speed=0.001, wait=False) for rig, to_m in ((one, 0.008), (other, 0.006))]

            async def watch() -> list[tuple[bool, float]]:
                return [(motions[0].done, row["position_m"]) async for row in one.stream(0.295)]

            assert not any(motion.done for motion in motions), "both move"
            moved, seen = await asyncio.gather(asyncio.gather(*motions), watch())
            assert [ended["position_m"] for ended in moved] == pytest.approx([0.008, 0.006], abs=2e-4)
            assert all(motion.done for motion in motions)
            assert len(seen) == 30 and not seen[0][0], "rows came while the motion was awaited"
            assert seen[-1][1] > seen[0][1]

    asyncio.run(main())


@pytest.fixture
def eager_threads() -> Iterator[None]:
    """Threads that take Python's lock from each other as often as they can."""
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval_s)


@pytest.mark.usefixtures("eager_threads")
def test_two_readers_of_one_rig_each_see_every_row() -> None:
    async def times(rig: tsa_rig.Rig) -> list[float]:
        return [row["t_s"] async for row in rig.stream(7.995)]

    async def main() -> None:
        with emulated(1) as rig:
            for seen in await asyncio.gather(times(rig), times(rig)):
                steps = [later - earlier for earlier, later in zip(seen, seen[1:])]
                assert len(steps) == 799 and steps == pytest.approx([0.01] * 799, abs=1e-4)

    asyncio.run(main())


def test_a_cancelled_task_leaves_the_motion_and_the_block_stops_it() -> None:
    async def main() -> None:
        with emulated(1) as rig:
            await asyncio.to_thread(rig.home)
            motion = rig.move(0.020, speed=0.001, wait=False)
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(motion, timeout=0.05)
            assert not motion.done
        with pytest.raises(tsa_rig.OperationError) as ended:
            await motion
        assert ended.value.kind == "stopped"

    asyncio.run(main())
