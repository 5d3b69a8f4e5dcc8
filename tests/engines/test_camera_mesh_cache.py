"""The mesh cache: equal pictures, no damaged mesh, bounded size, and no failure where nothing can be written."""

import hashlib
import os
import resource
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from lingjing.engines.camera import array_cache, cityscape, ground
from lingjing.engines.camera.array_cache import cached_array
from lingjing.engines.camera.building_meshes import building
from lingjing.engines.camera.ground import build_ground
from lingjing.engines.camera.instances import ROW, matrix, mesh_radius, prop_batches
from lingjing.engines.camera.mesh_cache import MeshCache
from lingjing.engines.camera.noise import grain_texture, noise_texture
from lingjing.engines.camera.structure_meshes import solid
from lingjing.engines.camera.tile_mesh import TileMesh, mesh_tile
from lingjing.scene.city import City, Land, Prop
from tests.engines.camera_town import WHY_NOT, CameraEngine, look, pieces, ready

CITY = City(id="c", origin=(0.0, 0.0), bounds=(-400.0, -400.0, 400.0, 400.0))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("LINGJING_NO_CACHE", raising=False)
    return tmp_path / "lingjing" / "meshes"


def mesh() -> TileMesh:
    return mesh_tile(pieces(), (), {}, lambda east, north: 0.0)


def counted() -> tuple[Callable[[], TileMesh], list[int]]:
    made: list[int] = []

    def make() -> TileMesh:
        made.append(1)
        return mesh()

    return make, made


def bytes_of(mesh: TileMesh) -> tuple[object, ...]:
    parts = tuple((name, p.vertices.tobytes(), p.index.tobytes()) for name, p in mesh.parts.items())
    return parts, mesh.coarse, mesh.boxes.tobytes(), mesh.low.tobytes(), mesh.high.tobytes()


def test_a_rebuilt_tile_reuses_the_meshes_cached_in_the_process() -> None:
    first = bytes_of(mesh())
    known = building.cache_info().hits
    assert bytes_of(mesh()) == first and building.cache_info().hits >= known + len(pieces().buildings)
    building.cache_clear()
    solid.cache_clear()
    assert bytes_of(mesh()) == first


def test_a_cached_texture_is_identical_and_a_damaged_one_is_rebuilt(folder: Path) -> None:
    made: list[int] = []

    def make() -> npt.NDArray[np.uint8]:
        made.append(1)
        return grain_texture()

    first, second = cached_array("grain", make), cached_array("grain", make)
    assert (first.shape, first.dtype, first.tobytes()) == (second.shape, second.dtype, second.tobytes())
    assert len(made) == 1
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    assert cached_array("grain", make).tobytes() == first.tobytes()
    assert len(made) == 2
    assert cached_array("another", make).tobytes() == first.tobytes()
    assert len(list(folder.iterdir())) == 2


def test_a_texture_is_built_if_the_cache_cannot_be_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.parent.write_bytes(b"no folder")
    # The name is unique to this test: the temporary folder belongs to the process, and other tests keep textures there.
    assert cached_array("nowhere", lambda: np.zeros((2, 2, 1), np.uint8)).shape == (2, 2, 1)
    monkeypatch.setenv("LINGJING_NO_CACHE", "1")
    assert cached_array("grain", lambda: np.ones((2, 2, 1), np.uint8)).all()


def test_the_ground_of_a_known_city_is_read_from_the_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """The ground of another city is drawn."""
    noise = noise_texture()[::4, ::4, 0]
    island = Land(polygon=((0.0, 0.0), (90.0, 0.0), (90.0, 60.0), (0.0, 60.0)), top_m=4.0, surface="grass")
    city = msgspec.structs.replace(CITY, lands=(island,))
    first = build_ground(city, noise)

    def drawn_again(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(ground, "_steps_inside", drawn_again)
    monkeypatch.setattr(ground, "_drawn_shore", drawn_again)
    second = build_ground(city, noise)
    assert second.shore.tobytes() == first.shore.tobytes()
    assert [part.vertices.tobytes() for part in second.surfaces] == [part.vertices.tobytes() for part in first.surfaces]
    for other in (island.polygon[:3], tuple((x + 1.0, y) for x, y in island.polygon)):
        with pytest.raises(AssertionError):
            build_ground(msgspec.structs.replace(CITY, lands=(msgspec.structs.replace(island, polygon=other),)), noise)


def test_a_cached_mesh_is_identical_and_is_not_rebuilt(folder: Path) -> None:
    make, made = counted()
    first = MeshCache(CITY).tile((0, -1), make)
    second = MeshCache(CITY).tile((0, -1), make)
    assert bytes_of(first) == bytes_of(second)
    assert len(made) == 1
    assert second.boxes.shape == first.boxes.shape
    assert [path.name.endswith("-0_-1.mesh") for path in folder.iterdir()] == [True]


def test_the_cache_distinguishes_cities_tiles_and_code_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    make, made = counted()
    MeshCache(CITY).tile((0, 0), make)
    MeshCache(CITY).tile((0, 1), make)
    MeshCache(msgspec.structs.replace(CITY, datum_m=1.0)).tile((0, 0), make)
    monkeypatch.setattr(array_cache, "_code_sha256", lambda: "of another version")
    MeshCache(CITY).tile((0, 0), make)
    assert len(made) == 4


def signed(data: bytes) -> bytes:
    return hashlib.sha256(data).digest() + data


def out_of_bounds(data: bytes) -> bytes:
    """Return a file with a valid hash and a first index that names no vertex."""
    parts, *rest = msgspec.msgpack.decode(data[32:])
    parts["plain"] = (parts["plain"][0], np.uint32(1 << 30).tobytes() + parts["plain"][1][4:])
    return signed(msgspec.msgpack.encode([parts, *rest]))


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[:40],
        lambda data: data[:-1],
        lambda data: data[:5000] + bytes([data[5000] ^ 1]) + data[5001:],
        lambda data: signed(b"\x00"),
        lambda data: signed(msgspec.msgpack.encode([{}, 0, b"", b""])),
        lambda data: signed(msgspec.msgpack.encode([{"wall": (b"abc", b"")}, 0, b"", b""])),
        out_of_bounds,
    ],
    ids=["empty", "cut", "short", "flipped", "no mesh", "no parts", "no vertices", "index out of bounds"],
)
def test_a_damaged_file_is_rebuilt(folder: Path, damage: Callable[[bytes], bytes]) -> None:
    make, made = counted()
    good = bytes_of(MeshCache(CITY).tile((0, 0), make))
    (file,) = folder.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    assert bytes_of(MeshCache(CITY).tile((0, 0), make)) == good
    assert len(made) == 2
    assert bytes_of(MeshCache(CITY).tile((0, 0), make)) == good
    assert len(made) == 2, "the file was not written anew"


def test_a_disabled_cache_is_neither_read_nor_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make, made = counted()
    MeshCache(CITY).tile((0, 0), make)
    monkeypatch.setenv("LINGJING_NO_CACHE", "1")
    before = sorted(folder.iterdir())
    MeshCache(CITY).tile((0, 0), make)
    MeshCache(CITY).tile((0, 1), make)
    assert len(made) == 3
    assert sorted(folder.iterdir()) == before


def test_a_full_disk_causes_no_error(folder: Path) -> None:
    make, made = counted()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        cache = MeshCache(CITY)
        good = bytes_of(cache.tile((0, 0), make))
        cache.tile((0, 1), make)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(made) == 2
    assert list(folder.iterdir()) == []
    assert good == bytes_of(mesh())


def test_a_folder_that_cannot_be_created_causes_no_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.parent.parent.mkdir(exist_ok=True)
    folder.parent.write_text("a file where the folder should be")
    monkeypatch.setattr("lingjing.data._temporary_cache", lambda: "")
    make, made = counted()
    MeshCache(CITY).tile((0, 0), make)
    assert len(made) == 1


def test_concurrent_writers_leave_no_partial_file(folder: Path) -> None:
    good = bytes_of(mesh())
    children = []
    for _ in range(4):
        pid = os.fork()
        if pid == 0:
            wrong = 1
            try:
                for _ in range(10):
                    cache = MeshCache(CITY)
                    assert bytes_of(cache.tile((0, 0), mesh)) == good
                    for file in folder.glob("*.mesh"):
                        file.unlink(missing_ok=True)
                wrong = 0
            finally:
                os._exit(wrong)
        children.append(pid)
    assert [os.waitpid(pid, 0)[1] for pid in children] == [0] * 4
    assert list(folder.glob(".new-*")) == []


def test_batched_props_have_the_same_matrices_as_single_props() -> None:
    props = tuple(
        Prop(id=f"p{k}", cls="tree", model="tree", position=(3.1 * k, -7.7 * k, 0.3 * k), heading_deg=37.0 * k,
             scale=0.7 + 0.11 * k, floating=k % 2 == 0, options={"variant": k % 2})
        for k in range(12)
    )  # fmt: skip
    batches = prop_batches(msgspec.structs.replace(pieces(), props=props))
    for batch in batches:
        mine = [p for p in props if batch.key == "tree" or batch.key.endswith(f"-{p.options['variant']}")]
        assert len(mine) == len(batch.rows) > 0
        for prop, got, radius, floating in zip(mine, batch.rows, batch.radius, batch.floating, strict=True):
            wanted = np.zeros(1, ROW)
            wanted["rows"] = matrix(prop.position, prop.heading_deg, 0.0, 0.0, prop.scale)
            assert np.array_equal(got["rows"], wanted["rows"][0])
            assert got["plane"] == np.float32(prop.position[2])
            assert radius == mesh_radius(batch.mesh) * prop.scale
            assert floating == prop.floating


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_pictures_of_a_cached_city_equal_those_of_a_built_one(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def pictures() -> list[bytes]:
        camera = CameraEngine()
        ready(camera)
        try:
            frames = [look(camera, (0.0, 0.0, 90.0), "front"), look(camera, (60.0, 40.0, 120.0))]
            return [frame.rgb.tobytes() + frame.depth.tobytes() for frame in frames]
        finally:
            camera.close()

    made = pictures()
    assert len(list(folder.glob("*.mesh"))) > 1

    def must_not_mesh(*arguments: object) -> TileMesh:
        raise AssertionError("a kept tile was meshed again")

    monkeypatch.setattr(cityscape, "mesh_tile", must_not_mesh)
    assert pictures() == made
