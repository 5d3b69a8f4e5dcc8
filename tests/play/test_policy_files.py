"""Policies by file: the accepted files, and the error messages for the author."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.errors import UsageError, hint_of
from lingjing.play.option_sharing import share_arguments
from lingjing.play.policy_files import load_policy
from lingjing.play.python_files import function_of
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import PolicyPlugin
from lingjing.testing import PluginHost, build_policy

GOOD = '''
class Scout:
    """Looks around."""

    def __init__(self, height: str = "80") -> None:
        self.height = float(height)

    async def reset(self, brief): ...

    async def act(self, observation, inbox): ...
'''


class _Named:
    @hookimpl
    def lingjing_policies(self):
        return [PolicyPlugin(name="named", factory=object)]


@pytest.fixture
def host() -> PluginHost:
    return PluginHost(entry_points=False, extra=[_Named()])


@pytest.fixture
def write(tmp_path: Path):
    def put(text: str, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return put


def refused(spec: str, host: PluginHost) -> UsageError:
    with pytest.raises(UsageError) as caught:
        load_policy(spec, host)
    return caught.value


def test_a_name_is_looked_up_in_the_host(host) -> None:
    assert load_policy("named", host).name == "named"
    assert "named" in refused("unheard-of", host).hint


def test_a_class_in_a_file_is_a_policy_whose_name_has_no_folder(host, write) -> None:
    plugin = load_policy(f"{write(GOOD)}:Scout", host)
    assert (plugin.name, plugin.privileged, plugin.summary) == ("mine.py:Scout", False, "Looks around.")
    assert build_policy(plugin, {"height": "120"}).height == 120.0


def test_the_class_may_be_omitted_if_the_file_has_only_one(host, write) -> None:
    assert load_policy(str(write(GOOD)), host).name == "mine.py:Scout"
    both = write(GOOD + GOOD.replace("Scout", "Other"))
    assert "Scout, Other" in refused(str(both), host).hint


def test_privileged_is_declared_by_the_class(host, write) -> None:
    text = GOOD.replace('"""Looks around."""', "privileged = True")
    assert load_policy(f"{write(text)}:Scout", host).privileged is True


def test_declarations_of_a_class_are_inherited(host, write) -> None:
    """A policy that extends an oracle of one's own plays as an oracle, and takes the options of what it extends."""
    text = """
from lingjing.plugins.options import PluginOptions

class Height(PluginOptions):
    height: float = 80.0

class Base:
    privileged = True
    options = Height

    def __init__(self, options: Height) -> None:
        self.height = options.height

    async def reset(self, brief): ...

    async def act(self, observation, inbox): ...

class Higher(Base):
    def __init__(self, options: Height) -> None:
        super().__init__(options)
        self.height *= 2
"""
    plugin = load_policy(f"{write(text)}:Higher", host)
    assert plugin.privileged is True
    assert build_policy(plugin, {"height": "50"}).height == 100.0


def test_a_file_imports_its_neighbours(host, write) -> None:
    write("SPEED = 3\n", "neighbour_of_mine.py")
    plugin = load_policy(f"{write('from neighbour_of_mine import SPEED' + chr(10) + GOOD)}:Scout", host)
    assert plugin.name == "mine.py:Scout"


def test_a_missing_file_is_named(host, tmp_path) -> None:
    error = refused(f"{tmp_path}/none.py:Scout", host)
    assert "none.py" in str(error)
    assert "lingjing new agent" in error.hint


def test_a_missing_class_suggests_the_nearest(host, write) -> None:
    error = refused(f"{write(GOOD)}:Scuot", host)
    assert "Scuot" in str(error)
    assert error.hint == "did you mean `Scout`?"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\nimport no_such_package_anywhere\n", "mine.py:2: ModuleNotFoundError"),
        ("x = 1\ny = 2\n\nclass Scout\n", "mine.py:4: expected ':'"),
        ("def f():\n    return 1 / 0\n\nf()\n", "mine.py:2: ZeroDivisionError"),
        ("raise SystemExit(3)\n", "mine.py:1: SystemExit"),
    ],
)
def test_a_fault_in_the_file_gives_its_line(host, write, text, message) -> None:
    assert message in str(refused(f"{write(text)}:Scout", host))


def test_bytes_that_are_no_text_are_refused(host, tmp_path) -> None:
    (tmp_path / "mine.py").write_bytes(b"\xff\xfe\x00class Scout: ...")
    assert "mine.py" in str(refused(f"{tmp_path}/mine.py:Scout", host))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("class Scout: ...\n", "no method `reset`"),
        (GOOD.replace("async def act", "async def perform"), "no method `act`"),
        (GOOD.replace("async def act", "def act"), "must be `async def act"),
        ("Scout = 3\n", "not a class"),
    ],
)
def test_a_class_without_the_two_methods_is_refused(host, write, text, message) -> None:
    assert message in str(refused(f"{write(text)}:Scout", host))


def test_arguments_that_the_policy_does_not_take_are_named(host, write) -> None:
    plugin = load_policy(f"{write(GOOD)}:Scout", host)
    with pytest.raises(UsageError, match="hight") as caught:
        build_policy(plugin, {"hight": "3"})
    assert caught.value.faults[0].hint == "did you mean `height`?"
    with pytest.raises(UsageError, match="could not convert"):
        build_policy(plugin, {"height": "tall"})


def test_files_of_one_name_in_two_folders_hold_two_policies(host, tmp_path) -> None:
    names = []
    for folder, parameter in (("a", "alpha"), ("b", "beta")):
        (tmp_path / folder).mkdir()
        methods = "    async def reset(self, brief): ...\n    async def act(self, observation, inbox): ...\n"
        text = f"class P:\n    def __init__(self, {parameter}='0'): ...\n{methods}"
        (tmp_path / folder / "pol.py").write_text(text, encoding="utf-8")
        names.append(f"{tmp_path / folder}/pol.py:P")
    plugins = {name: load_policy(name, host) for name in names}
    shares = share_arguments(plugins, {"alpha": "1", "beta": "2"})
    assert shares == {names[0]: {"alpha": "1"}, names[1]: {"beta": "2"}}
    with pytest.raises(UsageError) as caught:
        share_arguments({names[0]: plugins[names[0]]}, {"gamma": "3"})
    assert f"{names[0]}`: option `gamma` is not known; known: alpha" in str(caught.value)


def test_arguments_go_to_the_policies_that_take_them():
    def one(alpha="1"):
        raise NotImplementedError

    def two(beta="2", **others):
        raise NotImplementedError

    def three(gamma="3"):
        raise NotImplementedError

    first, second, third = (PolicyPlugin(name=f.__name__, factory=f) for f in (one, two, three))
    given = {"alpha": "a", "gamma": "c"}
    assert share_arguments({"one": first, "three": third}, given) == {"one": {"alpha": "a"}, "three": {"gamma": "c"}}
    assert share_arguments({"one": first, "two": second}, given) == {"one": {"alpha": "a"}, "two": given}
    with pytest.raises(UsageError, match="policy `one`: option `delta` is not known; known: alpha"):
        share_arguments({"one": first}, {"delta": "d"})
    with pytest.raises(UsageError, match="policies `one`, `three`: option `delta` is not known"):
        share_arguments({"one": first, "three": third}, {"delta": "d"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def lost(trace): return True\n1 / 0\n", "mine.py:2: ZeroDivisionError: division by zero"),
        ("def lost(trace: return True\n", "mine.py:1: "),
        ("def won(trace): return True\n", "` has no function `lost`"),
    ],
)
def test_an_error_in_a_file_with_a_function_is_reported(write, text: str, message: str) -> None:
    path = write("def lost(trace): return trace > 2\n", "good.py")
    assert function_of(f"{path}:lost", "predicate")(3)
    with pytest.raises(UsageError) as caught:
        function_of(f"{write(text)}:lost", "predicate")
    assert message in str(caught.value)


def test_a_file_without_read_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refuses)
    with pytest.raises(UsageError, match=r"cannot read the policy file `.*`: Permission denied") as raised:
        function_of(f"{tmp_path / 'a.py'}:f", "policy")
    assert "ls -ld" in hint_of(raised.value)
