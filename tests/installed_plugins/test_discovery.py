"""A plug-in that raises, ends its process, never returns or has broken metadata is named, and stops nothing else."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.cli import doctor
from lingjing.errors import ExitCode, PluginError, UsageError
from lingjing.installed_plugins import discovery, slow_trials
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.kinds import engine_kind
from lingjing.play.policy_processes.preloading import policy_host, preload
from lingjing.testing import PluginHost, run_command
from tests.installed_plugins.conftest import Site
from tools.python_forks import run_python

OFFER = """
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import PolicyPlugin
from lingjing.plugins.engine import EnginePlugin
@hookimpl
def lingjing_policies():
    return [PolicyPlugin(name={name!r}, factory=object)]
"""
FAULTS = {
    "raises": ("raise RuntimeError('no licence')", "does not load: RuntimeError: no licence"),
    "exits": ("raise SystemExit(0)", "does not load: SystemExit: 0"),
    "ends": ("import os; os._exit(0)", "ends its process with code 0 while importing `ends`"),
    "aborts": ("import os; os.abort()", "ends its process by signal 6 while importing `aborts`"),
    "broken": ("def (", "does not load: SyntaxError"),
    "lost": (None, "does not load: ModuleNotFoundError: No module named 'lost'"),
    "absent": ("from numpy import no_such_thing", "does not load: ImportError"),
    "scribbles": (
        "import os, sys; os.write(int(sys.argv[1]), b'junk'); os._exit(0)",
        "wrote into the answer of its trial",
    ),
    "wrong": (
        "from lingjing.plugins.hookspecs import hookimpl\n@hookimpl\ndef lingjing_policies(world): return []",
        "does not load: failed in lingjing_policies: it takes `world`, and the hook has the parameters: none",
    ),
    "hook": (
        "from lingjing.plugins.hookspecs import hookimpl\n@hookimpl\ndef lingjing_scenes(): raise ValueError('no map')",
        "failed in lingjing_scenes: ValueError: no map (hook.py:3)",
    ),
    "leaves": (
        "from lingjing.plugins.hookspecs import hookimpl\n@hookimpl\ndef lingjing_models(): raise SystemExit(3)",
        "failed in lingjing_models: SystemExit: 3",
    ),
    "forks": ("import os, time\nif os.fork() == 0: time.sleep(3600)", "leaves a process running"),
    "hides": (
        "import os, time\nif os.fork() == 0: os.setsid(), os.fork() or time.sleep(3600), os._exit(0)\nos.wait()",
        "leaves a process running",
    ),
    "threads": (
        "import threading, time\nthreading.Thread(target=time.sleep, args=(3600,)).start()",
        "leaves a thread running",
    ),
    "moves": ("import os; os.chdir('/usr')", "changes the working folder of each command"),
    "closes": ("import os; os.close(1)", "changes the standard streams of each command"),
    "ignores": (
        "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)",
        "changes the handlers of signals of each command",
    ),
    "parting": ("import atexit, os\natexit.register(os._exit, 5)", "ends its process with code 5 while ending"),
}


PARENT = """
import subprocess, sys, time
subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(3600)", __file__])
time.sleep(3600)
"""

WAITS = """
import time
from lingjing.plugins.hookspecs import hookimpl
@hookimpl
def lingjing_engines(): time.sleep(3600)
"""


def faults_of(host: PluginHost) -> dict[str, str]:
    return {fault.plugin: fault.reason for fault in host.faults}


def test_every_broken_plugin_is_named_and_the_others_work(site: Site, capsys, descendants) -> None:
    before = descendants(os.getpid())
    for name, (code, _) in FAULTS.items():
        site.add(name, code)
    site.add("good", OFFER.format(name="good"))
    host = PluginHost()
    assert "good" in host.policies and "heuristic" in host.policies and "multirotor" in host.engines
    reasons = faults_of(host)
    assert reasons.keys() == FAULTS.keys()
    for name, (_, reason) in FAULTS.items():
        assert reasons[name].startswith(reason), name
    assert run_command(["plugins"]) == 2
    printed = capsys.readouterr()
    for name in ("good", "heuristic", "multirotor"):
        assert re.search(rf"^(policy|engine) +{name} ", printed.out, re.MULTILINE)
    for name, (_, reason) in FAULTS.items():
        assert f"error: plug-in `{name}` (lingjing-{name} 1.0): {reason}" in printed.err
    assert "Traceback" not in printed.err
    finding = doctor.check_plugins()
    assert not finding.ok and all(f"`{name}`" in finding.found for name in FAULTS)
    assert descendants(os.getpid()) == before


@pytest.mark.parametrize(
    ("name", "code", "stage"),
    [
        ("spins", "while True: pass", "importing `spins`"),
        ("sleeps", PARENT, "importing `sleeps`"),
        (
            "waits",
            WAITS,
            "calling lingjing_engines",
        ),
    ],
)
def test_a_plugin_that_never_returns_is_killed_with_its_children(
    site: Site, name: str, code: str, stage: str, monkeypatch: pytest.MonkeyPatch, descendants
) -> None:
    before = descendants(os.getpid())
    monkeypatch.setattr(discovery, "DEADLINE_S", 1.5)
    site.add(name, code)
    host = PluginHost()
    assert faults_of(host)[name].endswith(f"s while {stage}") or faults_of(host)[name].endswith("s while starting")
    assert "multirotor" in host.engines
    assert descendants(os.getpid()) == before
    commands = [path.read_bytes() for path in Path("/proc").glob("[0-9]*/cmdline") if path.exists()]
    assert not [command for command in commands if str(site.folder).encode() in command]


SLOW = "import time\nopen('tried', 'a').write('x')\ntime.sleep(3600)"


@pytest.fixture
def slow(site: Site, monkeypatch: pytest.MonkeyPatch) -> Callable[[], str]:
    """Return a function that returns the fault which the next command finds in a plug-in that never returns."""
    monkeypatch.setattr(discovery, "DEADLINE_S", 1.5)
    monkeypatch.setenv("XDG_CACHE_HOME", str(site.folder / "cache"))
    monkeypatch.chdir(site.folder)
    site.add("spins", SLOW)

    def fault_of_next_command() -> str:
        monkeypatch.setenv(discovery.KNOWN, "{}")
        return faults_of(PluginHost()).get("spins", "")

    return fault_of_next_command


def test_only_the_first_command_waits_for_a_plugin_that_never_returns(
    site: Site, slow: Callable[[], str], capsys: pytest.CaptureFixture[str]
) -> None:
    first = slow()
    assert first.startswith("gives no answer within 2 s while")
    tried = (site.folder / "tried").read_text()
    assert slow() == f"{first}; {discovery.TRIED_EARLIER}"
    assert (site.folder / "tried").read_text() == tried
    os.environ[discovery.KNOWN] = "{}"
    assert run_command(["plugins"]) == ExitCode.USAGE
    assert (site.folder / "tried").read_text() == f"{tried}x"
    assert discovery.TRIED_EARLIER not in capsys.readouterr().err
    assert discovery.TRIED_EARLIER in slow()


def test_a_plugin_that_never_returned_is_tried_again_once_it_was_changed(
    site: Site, slow: Callable[[], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert slow() and slow().endswith(discovery.TRIED_EARLIER)
    (site.folder / "spins.py").write_text(OFFER.format(name="spins"))
    monkeypatch.setattr(discovery, "DEADLINE_S", 20.0)
    assert slow() == ""


@pytest.mark.parametrize("change", ["expired", "deadline", "broken", "off"])
def test_a_cached_fault_is_not_used_after_its_conditions_changed(
    site: Site, slow: Callable[[], str], change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = [slow()]
    if change == "expired":
        monkeypatch.setattr(slow_trials, "KEPT_S", 0.0)
    elif change == "deadline":
        monkeypatch.setattr(discovery, "DEADLINE_S", 1.6)
    elif change == "off":
        monkeypatch.setenv("LINGJING_NO_CACHE", "1")
    else:
        (kept,) = (site.folder / "cache" / "lingjing" / "trials").iterdir()
        kept.write_bytes(b"junk")
    tries.append(slow())
    assert all(tries) and not any(fault.endswith(discovery.TRIED_EARLIER) for fault in tries)


def test_child_processes_do_not_repeat_a_trial(site: Site, monkeypatch) -> None:
    site.add("raises", "open('tried', 'a').write('x'); raise RuntimeError('no licence')")
    monkeypatch.chdir(site.folder)
    PluginHost()
    PluginHost()
    code = "from lingjing.plugins.host import PluginHost; print(*PluginHost().faults)"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "no licence" in output
    assert (site.folder / "tried").read_text() == "x"


BROKEN_METADATA = [
    (b"[lingjing]\nno equals sign\n", "its entry_points.txt cannot be read"),
    (b"[lingjing]\nodd = \xff\xfe\n", "its entry_points.txt cannot be read (UnicodeDecodeError)"),
    (b"[lingjing]\nodd = two words!\n", "has the value 'two words!', which names no module"),
]


@pytest.mark.parametrize(("text", "reason"), BROKEN_METADATA)
def test_broken_metadata_is_named_and_hides_no_other_plugin(site: Site, text: bytes, reason: str) -> None:
    site.add("odd", None, entry_points=text)
    site.add("good", OFFER.format(name="good"))
    (fault,) = PluginHost().faults
    assert (fault.distribution, reason in fault.reason) == ("lingjing-odd 1.0", True)
    assert "good" in PluginHost().policies
    assert engine_kind("no-such-engine").name == "no-such-engine"


def test_broken_metadata_stops_no_process_of_policies_and_no_command(site: Site) -> None:
    """The library function that lists entry points raises for all of them, and pydantic calls it too."""
    site.add("odd", None, entry_points=b"[lingjing]\nno equals sign\n")
    preload('["heuristic"]')
    assert policy_host(("agents",)).policy("heuristic").name == "heuristic"
    call = [sys.executable, "-m", "lingjing.cli.main", "plugins"]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "heuristic" in done.stdout
    assert done.stderr.startswith("error: plug-in `?` (lingjing-odd 1.0): its entry_points.txt cannot be read")


def test_a_prepared_host_holds_no_foreign_plugin(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """The process from which policies are forked prepares hosts, and loads no foreign code."""
    monkeypatch.chdir(site.folder)
    site.add("stranger", "open('loaded', 'w')\n" + OFFER.format(name="stranger"))
    preload('["heuristic", "stranger"]')
    assert not Path("loaded").exists()
    assert policy_host(("agents",)) is policy_host(("agents",))
    assert policy_host(()) is policy_host(()) and policy_host(()).policies == {}
    assert "stranger" not in policy_host(("agents",)).policies
    both = policy_host(("agents", "stranger"))
    assert {"heuristic", "stranger"} <= both.policies.keys() and Path("loaded").exists()


def test_output_of_a_plugin_goes_to_standard_error(site: Site, capsys) -> None:
    site.add("chatty", OFFER.format(name="chatty") + "\nprint('hello')\n")
    assert "chatty" in PluginHost().policies
    assert capsys.readouterr() == ("", "hello\n")


def test_a_distribution_without_metadata_is_named(site: Site) -> None:
    site.add("nameless", "raise RuntimeError('boom')")
    (site.folder / "lingjing_nameless-1.0.dist-info" / "METADATA").unlink()
    (fault,) = PluginHost().faults
    assert (fault.plugin, fault.distribution) == ("nameless", "lingjing_nameless-1.0.dist-info (no version)")


def test_broken_entry_points_of_other_groups_are_ignored(site: Site) -> None:
    site.add("other", None, entry_points=b"[console_scripts]\nno equals sign\n")
    assert find_entries(PLUGINS).broken == ()


def test_a_foreign_plugin_cannot_replace_a_plugin_of_the_project(site: Site) -> None:
    site.add("builtin", "raise RuntimeError('loaded')", value="impostor")
    site.add("first", OFFER.format(name="heuristic").replace("@hookimpl", "@hookimpl(trylast=True)"))
    host = PluginHost()
    assert host.sources["lingjing_policies", "heuristic"] == "agents"
    assert host.sources["lingjing_engines", "multirotor"] == "builtin"
    assert faults_of(host) == {
        "builtin": "lingjing-sim 0.1.0 has a plug-in of the same name",
        "first": "`heuristic` is offered twice by lingjing_policies: in `agents` and in `first`",
    }


def test_a_name_offered_by_two_foreign_plugins_is_an_error_when_it_is_used(site: Site) -> None:
    site.add("one", OFFER.format(name="twin"))
    site.add("two", OFFER.format(name="twin"))
    host = PluginHost()
    assert "twin" not in host.policies and host.policy("heuristic")
    with pytest.raises(PluginError, match="`twin` is offered twice by lingjing_policies: in `one` and in `two`"):
        host.policy("twin")


def test_an_unknown_name_gives_a_hint_to_plugins_that_do_not_load(site: Site) -> None:
    site.add("raises", "raise RuntimeError('no licence')")
    with pytest.raises(UsageError, match="no policy is called `scout`") as caught:
        PluginHost().policy("scout")
    assert "says why `raises` is not loaded" in caught.value.hint


def test_an_engine_with_a_failing_wanted_function_is_left_out(site: Site, instance_of, uav) -> None:
    code = "\n@hookimpl\ndef lingjing_engines():\n    return [EnginePlugin('odd', object, wanted=lambda one: 1 / 0)]\n"
    site.add("good", OFFER.format(name="good") + code)
    with pytest.warns(RuntimeWarning, match="engine `odd` is left out: its `wanted` failed: ZeroDivisionError"):
        assert select_engines(instance_of([uav()]), PluginHost()).local == ("multirotor",)


def test_a_broken_kinds_file_of_one_plugin_does_not_hide_other_kinds(site: Site, capsys) -> None:
    site.add("bad", None, value="bad.plugin")
    (site.folder / "bad").mkdir()
    (site.folder / "bad" / "kinds.json").write_text('{"engines": [{"name": "hover", "nonsense": 1}]}')
    assert engine_kind("elsewhere").name == "elsewhere"
    with pytest.raises(PluginError, match="bad"):
        engine_kind("hover")
    assert run_command(["plugins"]) == 2
    assert "plug-in `bad`: " in (output := capsys.readouterr().err) and "kinds.json does not describe kinds" in output


def test_a_missing_core_is_an_error_and_without_the_agents_the_rest_works(site: Site, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "lingjing_agents.plugin", None)
    host = PluginHost()
    assert "multirotor" in host.engines and faults_of(host)["agents"].startswith("does not load: ModuleNotFoundError")
    monkeypatch.setitem(sys.modules, "lingjing.builtin", None)
    with pytest.raises(PluginError, match=r"plug-in `builtin` .*does not load"):
        PluginHost()


@pytest.mark.slow
def test_a_run_plays_without_broken_plugins_and_warns_about_each(site: Site, tmp_path: Path) -> None:
    for name in ("raises", "ends", "scribbles"):
        site.add(name, FAULTS[name][0])
    mission = Path(__file__).parents[1] / "cli" / "boats.ljs"
    call = [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--policy", "random", "--json",
            "--no-overview"]  # fmt: skip
    done = run_python(call, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["mission"] == "boats"
    for name in ("raises", "ends", "scribbles"):
        assert done.stderr.count(f"warning: plug-in `{name}` (lingjing-{name} 1.0)") == 1


def test_a_hook_that_fails_leaves_the_policy_of_its_plugin_in_place(site: Site) -> None:
    code = "\n@hookimpl\ndef lingjing_scenes():\n    raise ValueError('no map')\n"
    site.add("half", OFFER.format(name="scout") + code)
    host = policy_host(("half",))
    assert "scout" in host.policies
    assert [(fault.plugin, fault.reason) for fault in host.faults] == [
        ("half", "failed in lingjing_scenes: ValueError: no map (half.py:11)")
    ]
    assert host.sources["lingjing_policies", "scout"] == "half"


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("@hookimpl\ndef lingjing_polices():\n    return []", "there is no hook `lingjing_polices`"),
        ("def lingjing_policies():\n    return []", "`lingjing_policies` is not marked with `@hookimpl`"),
        ("", "offers nothing"),
    ],
)
def test_a_wrong_or_missing_hook_is_named(site: Site, code: str, reason: str) -> None:
    site.add("vain", f"from lingjing.plugins.hookspecs import hookimpl\n{code}\n")
    (fault,) = PluginHost().faults
    assert fault.plugin == "vain" and reason in fault.reason
