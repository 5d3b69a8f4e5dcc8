"""`lingjing scene export` and `lingjing trace export`: each file is read back by the reader of its format."""

from __future__ import annotations

import csv
import json
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import lingjing
from lingjing.mission.frames import from_geodetic
from lingjing.testing import mission_file, placed, run_command, shortened

pytestmark = pytest.mark.slow
FORMATS = {"glb": "city.glb", "geojson": "city.geojson", "sumo": "city.net.xml", "mjcf": "city.xml"}


@pytest.fixture(scope="module")
def city() -> Any:
    """Return the city of the bridge inspection, seed 0."""
    return placed(mission_file("bi"))[1]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("exports")
    for kind, name in FORMATS.items():
        assert run_command(["scene", "export", "bi", "--format", kind, "-o", str(folder / name)]) == 0
    assert sorted(path.name for path in folder.iterdir()) == sorted(FORMATS.values())
    return {kind: folder / name for kind, name in FORMATS.items()}


def test_shapely_reads_the_geojson_and_wgs84_is_exact(city: Any, files: dict[str, Path]) -> None:
    document = json.loads(files["geojson"].read_text(encoding="utf-8"))
    assert (document["type"], document["name"]) == ("FeatureCollection", city.id)
    by_kind: dict[str, list[dict[str, Any]]] = {}
    for feature in document["features"]:
        by_kind.setdefault(feature["properties"]["kind"], []).append(feature)
    assert len(by_kind["building"]) == len(city.buildings)
    assert len(by_kind["lane"]) == sum(len(road.lanes) for road in city.roads)
    assert len(by_kind["prop"]) == len(city.props)
    outlines = {building.id: building.polygon for building in city.buildings}
    for feature in by_kind["building"]:
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid
        assert shape.exterior.is_ccw
        metres = [from_geodetic(lat, lon, city.origin) for lon, lat in shape.exterior.coords]
        declared = shapely.Polygon(outlines[feature["properties"]["id"]])
        assert shapely.hausdorff_distance(shapely.Polygon(metres), declared) < 1e-6


def test_proj_agrees_with_the_degrees_to_a_micrometre(city: Any, files: dict[str, Path]) -> None:
    pyproj = pytest.importorskip("pyproj", reason="pyproj is not installed")
    latitude, longitude = city.origin
    back = pyproj.Transformer.from_crs(
        "EPSG:4326", f"+proj=tmerc +lat_0={latitude} +lon_0={longitude} +k=1 +ellps=WGS84", always_xy=True
    )
    document = json.loads(files["geojson"].read_text(encoding="utf-8"))
    props = [feature for feature in document["features"] if feature["properties"]["kind"] == "prop"]
    places = {prop.id: prop.position[:2] for prop in city.props}
    for feature in props[:200]:
        metres = back.transform(*feature["geometry"]["coordinates"])
        assert metres == pytest.approx(places[feature["properties"]["id"]], abs=1e-6)


def test_gdal_reads_the_geojson(city: Any, files: dict[str, Path]) -> None:
    pyogrio = pytest.importorskip("pyogrio", reason="pyogrio is not installed")
    described = pyogrio.read_info(files["geojson"])
    assert described["crs"] == "EPSG:4326"
    assert described["features"] == len(json.loads(files["geojson"].read_text(encoding="utf-8"))["features"])
    west, south, east, north = described["total_bounds"]
    assert west < city.origin[1] < east
    assert south < city.origin[0] < north


def test_sumolib_reads_the_network(city: Any, files: dict[str, Path]) -> None:
    sumolib = pytest.importorskip("sumolib", reason="sumolib is not installed")
    net = sumolib.net.readNet(str(files["sumo"]))
    assert {edge.getID() for edge in net.getEdges()} == {road.id for road in city.roads}
    assert b"<!-- procedural -->" in files["sumo"].read_bytes()[:200]
    if importable("pyproj"):
        x, y = net.convertLonLat2XY(city.origin[1], city.origin[0])
        assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)


def importable(name: str) -> bool:
    import importlib.util

    return importlib.util.find_spec(name) is not None


def test_mujoco_reads_the_model_and_a_ray_hits_a_roof(city: Any, files: dict[str, Path]) -> None:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    model = mujoco.MjModel.from_xml_path(str(files["mjcf"]))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert f"lat_0={city.origin[0]!r}" in files["mjcf"].read_text(encoding="utf-8")
    building = max(city.buildings, key=lambda each: each.top_m)
    inside = shapely.Polygon(building.polygon).representative_point()
    hit = np.array([-1], np.int32)
    fall = mujoco.mj_ray(model, data, (inside.x, inside.y, 500.0), (0.0, 0.0, -1.0), None, 1, -1, hit)
    assert 500.0 - fall == pytest.approx(building.top_m, abs=0.01)
    assert building.id in model.geom(int(hit[0])).name


def test_trimesh_reads_the_gltf_with_y_up(city: Any, files: dict[str, Path]) -> None:
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    scene = trimesh.load_scene(files["glb"])
    assert scene.metadata["origin"] == {"latitude": city.origin[0], "longitude": city.origin[1]}
    for building in city.buildings[:50]:
        name = f"building/{building.id}"
        place, geometry = scene.graph.get(name)
        low, high = trimesh.transform_points(scene.geometry[geometry].bounds, place)
        outline = np.asarray(building.polygon)
        assert sorted((low[0], high[0])) == pytest.approx([outline[:, 0].min(), outline[:, 0].max()], abs=1e-3)
        assert sorted((-low[2], -high[2])) == pytest.approx([outline[:, 1].min(), outline[:, 1].max()], abs=1e-3)
        assert max(low[1], high[1]) == pytest.approx(building.top_m, abs=1e-3)
    assert all(len(mesh.faces) for mesh in scene.geometry.values())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "ssr"
    mission = shortened("ssr", 8)
    lingjing.run(mission, policy="random", out=folder, overview=False, world="inline", blank_pictures=True)
    return folder


def test_csv_and_parquet_hold_the_tables(run: Path, tmp_path: Path) -> None:
    trace = lingjing.read(run)
    rows = trace.rows("bodies")
    assert run_command(["trace", "export", str(run), "--format", "csv", "-o", str(tmp_path / "csv")]) == 0
    with (tmp_path / "csv" / "bodies.csv").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert [row["entity"] for row in read] == [row.entity for row in rows]
    assert [float(row["x_m"]) for row in read] == [row.x_m for row in rows]
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    assert run_command(["trace", "export", str(run), "--format", "parquet", "-o", str(tmp_path / "pq")]) == 0
    assert len(list((tmp_path / "pq").iterdir())) == 8
    for table in ("bodies", "messages", "decisions"):
        stored = parquet.ParquetFile(tmp_path / "pq" / f"{table}.parquet").read(use_threads=False)
        assert stored.num_rows == len(trace.rows(table))  # type: ignore[call-overload]
    bodies = parquet.ParquetFile(tmp_path / "pq" / "bodies.parquet").read(use_threads=False)
    assert bodies.column("z_m").to_pylist() == [row.z_m for row in rows]


def test_the_geojson_of_a_trace_has_the_ways_of_its_entities(run: Path, tmp_path: Path) -> None:
    target = tmp_path / "ways.geojson"
    assert run_command(["trace", "export", str(run), "--format", "geojson", "-o", str(target)]) == 0
    document = json.loads(target.read_text(encoding="utf-8"))
    ways = {f["properties"]["entity"]: f for f in document["features"] if f["properties"]["kind"] == "way"}
    trace = lingjing.read(run)
    boat = [row for row in trace.rows("bodies") if row.entity == "boat"]
    line = shapely.from_geojson(json.dumps(ways["boat"]["geometry"]))
    metres = [from_geodetic(lat, lon, (31.0, 121.5)) for lon, lat in line.coords]
    assert np.allclose(metres, [(row.x_m, row.y_m) for row in boat], atol=1e-6)
    assert ways["boat"]["properties"]["time_s"] == [row.time_s for row in boat]


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size: writing then fails as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("kind", ["glb", "geojson", "sumo", "mjcf"])
def test_a_city_export_that_exceeds_the_space_leaves_no_file(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with files_of_at_most(4096):
        code = run_command(["scene", "export", "bi", "--format", kind, "-o", str(tmp_path / "city")])
    assert code == 2
    assert "cannot write" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["csv", "parquet", "geojson"])
def test_a_trace_export_that_exceeds_the_space_leaves_no_file(
    kind: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with files_of_at_most(512):
        code = run_command(["trace", "export", str(run), "--format", kind, "-o", str(tmp_path / "out")])
    assert code == 2
    errors = capsys.readouterr().err
    assert "cannot write" in errors
    assert "nothing was left behind" in errors
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_argument_gives_one_message(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = str(tmp_path / "out")
    for words, message in (
        (["scene", "export", "bi", "--format", "gltf", "-o", target], "no format is called `gltf`"),
        (["scene", "export", "ssr", "--format", "sumo", "-o", target], "has no roads"),
        (["scene", "export", "bi", "--format", "glb", "-o", str(tmp_path / "no" / "x")], "cannot write"),
        (["trace", "export", str(run), "--format", "cvs", "-o", target], "did you mean `csv`"),
        (["trace", "export", str(run), "--format", "csv", "-o", str(tmp_path)], "exists already"),
        (["trace", "export", str(tmp_path), "--format", "csv", "-o", target], str(tmp_path)),
    ):
        assert run_command(words) == 2, words
        errors = capsys.readouterr().err
        assert message in errors
        assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []
