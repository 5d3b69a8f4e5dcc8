"""Whole episodes of the oracle with the real engines on documents that it once lost."""

import json
from pathlib import Path

import pytest

import lingjing

pytestmark = pytest.mark.slow


def document(task: str, cars: list[tuple[float, float]], state: dict, folder: Path) -> Path:
    """Return a `resetScenario` document with cars at places in centimetres."""
    fleet = [{"equipmentCode": f"CAR-{k}", "data": {"x": x, "y": y, "z": 0.0}} for k, (x, y) in enumerate(cars)]
    row = {"task_type": task, "initial_state": state}
    file = folder / "document.json"
    file.write_text(json.dumps({"equipmentList": {"autoVehicleEntityList": fleet}, "taskMatrix": [row]}))
    return file


def test_a_car_that_served_a_stop_beside_the_depot_loads_again(tmp_path: Path) -> None:
    """The stop refers to the depot too, so an assignment there keeps a loading pending until the body is full."""
    stops = [{"delId": k, "x": 5000.0 * k, "y": -4000.0, "z": 0.0, "demand": k + 1.0} for k in (1, 2, 3)]
    state = {"warehousePosition": {"x": 100.0, "y": -100.0, "z": 0.0}, "goalDelPosition": stops}
    cars = [(700.0 * k, -1000.0) for k in (1, 2, 3)]
    file = document("delivery task", cars, state, tmp_path)
    result = lingjing.run(file, policy="oracle", seed=0, out=tmp_path / "run", overview=False, world="inline")
    assert result.success, result.reason


def test_cars_drive_around_congestion_without_an_inspector(tmp_path: Path) -> None:
    jams = [{"conId": "c1", "x": 200.0, "y": 2400.0, "z": 0.0}, {"conId": "c2", "x": 18200.0, "y": 20200.0, "z": 0.0}]
    state = {"congestionPoints": jams, "goalPosition": {"x": 20200.0, "y": -34000.0, "z": 0.0}}
    file = document("multi cars", [(-12000.0, 20200.0), (-10500.0, 20200.0)], state, tmp_path)
    result = lingjing.run(file, policy="oracle", seed=1, out=tmp_path / "run", overview=False, world="inline")
    assert result.success, result.reason
