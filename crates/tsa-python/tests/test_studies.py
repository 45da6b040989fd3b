"""Studies, on two worker processes."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from distributed import Client, LocalCluster

import tsa_rig
from tsa_rig import studies

ROOT = Path(__file__).resolve().parents[3]
# Where `cargo xtask python` has built the emulator.
PROGRAMS = os.environ.get("TSA_PROGRAMS")
SCENE = ROOT / "scenes" / "default.toml"


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, Client(cluster) as client:
        yield client


def files(folder: Path) -> dict[str, int]:
    return {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}


def test_designs_say_which_rods_serve(client: Client, tmp_path: Path) -> None:
    grid = {"rod_radius_m": [0.0004, 0.0005], "string.k2": [0.127], "string_length_m": [0.097, -1.0]}
    found = studies.designs(SCENE, grid, [2.0, 8.0], 0.012, client=client, folder=tmp_path, turns=6.0)
    assert len(found) == 4 and (found["refused"] != "").sum() == 2
    assert all("string_length_m" in why for why in found["refused"] if why)
    good = found[found["refused"] == ""].set_index("rod_radius_m")
    # As the model itself has it.
    changed = tsa_rig.Scene.load(SCENE).with_constants(rod_radius_m=0.0004).mechanism()
    solved = changed.solve([2.0, 8.0], 6.0)
    assert not solved.error.any()
    assert good.loc[0.0004, "reach_m"] == pytest.approx(solved.contraction_m.min())
    assert good.loc[0.0004, "reach_m"] != good.loc[0.0005, "reach_m"]
    assert (good["tr_least_rad_per_m"] < good["tr_greatest_rad_per_m"]).all() and (good["speed_m_per_s"] > 0.0).all()
    assert list(good["serves"]) == list(good["reach_m"] >= 0.012)
    far = studies.designs(SCENE, {"k2": [0.127]}, [5.0], 0.5, client=client, folder=tmp_path, turns=40.0)
    assert far.loc[0, "limits"] and not far.loc[0, "serves"] and np.isnan(float(far.loc[0, "speed_m_per_s"] or np.nan))


def test_a_study_goes_on_from_what_is_done(client: Client, tmp_path: Path) -> None:
    def run(radii: list[float], travel_m: float = 0.01) -> Any:
        grid = {"rod_radius_m": radii}
        return studies.designs(SCENE, grid, [5.0], travel_m, client=client, folder=tmp_path, turns=3.0)

    run([0.0004])
    kept = files(tmp_path)
    assert len(kept) == 1
    first = next(tmp_path.iterdir())
    # What stands in the file is what is used.
    result = json.loads(first.read_text())
    result["result"]["reach_m"] = 7.0
    first.write_text(json.dumps(result))
    kept = files(tmp_path)
    both = run([0.0004, 0.0005])
    assert both.loc[0, "reach_m"] == 7.0 and both.loc[1, "reach_m"] < 1.0
    assert files(tmp_path).items() > kept.items() and len(files(tmp_path)) == 2
    run([0.0004], travel_m=0.011)
    assert len(files(tmp_path)) == 3, "a changed input is another task"
    first.write_text("{")
    with pytest.raises(ValueError, match=first.name):
        run([0.0004])


def test_bad_input_is_named(client: Client, tmp_path: Path) -> None:
    def designs(grid: Any, loads_n: Any = 5.0, travel_m: float = 0.01, folder: Path = tmp_path) -> None:
        studies.designs(SCENE, grid, loads_n, travel_m, client=client, folder=folder)

    with pytest.raises(ValueError, match="no constant `rod_diameter`"):
        designs({"rod_diameter": [0.001]})
    empty: list[Any] = [{}, {"rod_radius_m": []}, {"rod_radius_m": 0.0004}]
    for grid in empty:
        with pytest.raises(ValueError, match="grid"):
            designs(grid)
    with pytest.raises(ValueError, match="loads_n"):
        designs({"k2": [0.1]}, loads_n=[])
    with pytest.raises(ValueError, match="loads_n"):
        designs({"k2": [0.1]}, loads_n=[-1.0])
    with pytest.raises(ValueError, match="travel_m"):
        designs({"k2": [0.1]}, travel_m=float("nan"))
    taken = tmp_path / "taken"
    taken.write_text("")
    with pytest.raises(ValueError, match="taken is a file"):
        designs({"k2": [0.1]}, folder=taken)
    with pytest.raises(ValueError, match="none.csv"):
        studies.bootstrap([tmp_path / "none.csv"], SCENE, client=client, folder=tmp_path)
    with pytest.raises(ValueError, match="resamples"):
        studies.bootstrap([SCENE], SCENE, resamples=1, client=client, folder=tmp_path)
    with pytest.raises(ValueError, match="empty"):
        studies.seeds(SCENE, [], 0.01, client=client, folder=tmp_path, programs=PROGRAMS)
    with pytest.raises(FileNotFoundError, match="rig-emulator"):
        studies.seeds(SCENE, [1], 0.01, client=client, folder=tmp_path, programs=tmp_path)


def test_scenes_take_other_constants() -> None:
    scene = tsa_rig.Scene.load(SCENE)
    other = scene.with_constants(rod_radius_m=0.0004, **{"rig.gear_ratio": [30, 1]})
    assert other.as_dict()["geometry"]["rod_radius_m"] == 0.0004 and other.as_dict()["rig"]["gear_ratio"] == [30, 1]
    assert scene.as_dict()["geometry"]["rod_radius_m"] == 0.0005
    with pytest.raises(ValueError, match="rod_radius_m = -1"):
        scene.with_constants(rod_radius_m=-1)
    with pytest.raises(ValueError, match="load_n|no constant `rods`"):
        scene.with_constants(rods=2)
    with pytest.raises(ValueError, match="rod_radius_m = thick"):
        scene.with_constants(rod_radius_m="thick")


def sweep(path: Path, load_n: float, zero_m: float, noise_m: float) -> Path:
    """A sweep of a rig whose k1 is a tenth greater than the scene's."""
    scene = tsa_rig.Scene.load(SCENE)
    true = scene.with_constants(k1_per_n=1.1 * scene.as_dict()["string"]["k1_per_n"])
    turns = np.linspace(0.0, 7.5, 61)
    gap_m = true.mechanism().solve(load_n, turns).gap_m + zero_m
    gap_m += noise_m * np.random.default_rng(int(load_n * 1e3)).standard_normal(turns.size)
    lines = [f"{load_n},{turn:.6f},{gap:.9f}" for turn, gap in zip(turns, gap_m)]
    path.write_text("\n".join(["load_n,turns,gap_m", *lines]) + "\n")
    return path


def test_the_bootstrap_covers_the_truth(client: Client, tmp_path: Path) -> None:
    sweeps = [sweep(tmp_path / f"{k}.csv", load_n, 0.01 * k, 5e-6) for k, load_n in enumerate((2.0, 5.0, 10.0))]
    folder = tmp_path / "kept"
    found = studies.bootstrap(sweeps, SCENE, 20, client=client, folder=folder, law="length-ratio-k4")
    rows = found.set_index("constant")
    truth = 1.1 * tsa_rig.Scene.load(SCENE).as_dict()["string"]["k1_per_n"]
    k1 = rows.loc["string.k1_per_n"]
    assert k1["low"] < k1["high"] and k1["standard_error"] > 0.0 and k1["resamples"] > 10
    # Twenty resamples tell an interval roughly: twice its width holds the truth.
    assert abs(truth - k1["value"]) < 2.0 * (k1["high"] - k1["low"])
    kept = files(folder)
    again = studies.bootstrap(sweeps, SCENE, 20, client=client, folder=folder, law="length-ratio-k4")
    assert again.equals(found) and files(folder) == kept


def test_rigs_of_many_seeds_are_compared(client: Client, tmp_path: Path) -> None:
    def run(load: str) -> Any:
        return studies.seeds(
            SCENE, [1, 2], [0.008], client=client, folder=tmp_path, plant={"load": load}, speed=0.004, programs=PROGRAMS
        )

    found = run("0.5kg")
    assert list(found["seed"]) == [1, 2] and not found["refused"].any()
    assert (found["error_m"].abs() < 2e-4).all() and (found["true_error_m"].abs() < 5e-4).all()
    # The stated error holds the truth in nine of ten cases.
    assert ((found["load_n"] - found["true_load_n"]).abs() < 3.0 * found["load_error_n"]).all()
    assert found.loc[0, "true_error_m"] != found.loc[1, "true_error_m"], "another seed is another rig"
    with pytest.raises(ValueError, match="load"):
        run("heavy")


def test_a_killed_worker_loses_no_trial_and_makes_none_twice(client: Client, tmp_path: Path) -> None:
    killed: list[int] = []

    def kill_one(done: int, _: int) -> None:
        if not killed:
            pids = client.run(os.getpid)
            killed.append(next(iter(pids.values())))
            os.kill(killed[0], signal.SIGKILL)

    seeds = range(1, 4 * studies.CHUNK + 1)
    found = studies.trials(seeds, client=client, folder=tmp_path, kinds=["ideal"], progress=kill_one)
    assert killed and set(found["seed"]) == set(seeds)
    assert not found.duplicated(["kind", "seed", "moment"]).any()
    assert not found["ended"].str.startswith("worker").any()
    # The file has the same rows, and a second call computes nothing.
    (file,) = tmp_path.glob("trials-*.parquet")
    assert pd.read_parquet(file).equals(found)
    kept = files(tmp_path)
    again = studies.trials(seeds, client=client, folder=tmp_path, kinds=["ideal"])
    assert again.equals(found)
    assert {name: time for name, time in files(tmp_path).items() if name != file.name}.items() <= kept.items()
    with pytest.raises(ValueError, match="wooden"):
        studies.trials([1], client=client, folder=tmp_path, kinds=["wooden"])
    with pytest.raises(ValueError, match="seeds"):
        studies.trials([], client=client, folder=tmp_path)


def test_a_task_that_fails_is_tried_again_and_then_a_row(client: Client, tmp_path: Path) -> None:
    def work(task: dict[str, Any]) -> int:
        tries = Path(task["tries"])
        tries.write_text(tries.read_text() + "x" if tries.exists() else "x")
        if len(tries.read_text()) <= task["fails"]:
            raise RuntimeError("no luck")
        return 7

    def run(name: str, fails: int, failed: Any = None) -> list[Any]:
        task = {"tries": str(tmp_path / name), "fails": fails}
        return studies._run("luck", work, [task], client, tmp_path / "results", failed=failed)

    assert run("twice", studies.RETRIES) == [7]
    assert run("always", 99, failed=lambda _, error: str(error)) == ["no luck"]
    rows = studies._untried({"kind": "hard", "seeds": [3, 4]}, RuntimeError("no luck"))
    assert [(row["kind"], row["seed"], row["ended"]) for row in rows] == [
        ("hard", 3, "worker: no luck"),
        ("hard", 4, "worker: no luck"),
    ]
    with pytest.raises(RuntimeError, match="no luck"):
        run("never", 99)


def test_coverage_counts_what_is_held() -> None:
    rows = pd.DataFrame(
        {
            "kind": "nominal",
            "moment": "homed",
            "true_load_n": [2.0] * 10,
            "load_n": [2.05] * 9 + [2.5],
            "load_error_n": 0.1,
            "true_position_m": 0.0,
            "position_m": [1e-5] * 5 + [3e-5] * 5,
            "position_error_m": 2e-5,
        }
    )
    (found,) = studies.coverage(rows, ["kind", "load"]).to_dict("records")
    assert (found["kind"], found["load"], found["load_n"]) == ("nominal", "light", 10)
    assert found["load_held"] == pytest.approx(0.9) and found["position_held"] == pytest.approx(0.5)
    # Wilson's interval of 9 in 10 at 90 %.
    assert (found["load_low"], found["load_high"]) == pytest.approx((0.6528, 0.9773), abs=2e-3)
    assert found["load_stated"] == pytest.approx(0.1) and found["position_error"] == pytest.approx(3e-5)
