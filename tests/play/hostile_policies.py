"""Policies that attack their own process and its host, one kind of attack each, for tests of policy processes."""

import asyncio
import ctypes
import gc
import os
import random
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from array import array
from contextlib import suppress

import msgspec
import numpy as np

from lingjing.plugins.policy import Action, Decision, Outgoing


class Steady:
    """Counts its turns, and says where it is."""

    def __init__(self):
        self.turns = 0

    async def reset(self, brief):
        self.brief = brief

    async def act(self, observation, inbox):
        self.turns += 1
        return Decision(thought=f"turn {self.turns} in {os.getcwd()}")


class Chdir(Steady):
    async def act(self, observation, inbox):
        os.chdir("/")
        return Decision(thought="elsewhere")


class Close(Steady):
    async def act(self, observation, inbox):
        os.closerange(0, 4096)
        return Decision()


class Replace(Steady):
    async def act(self, observation, inbox):
        from lingjing.testing import TraceWriter

        TraceWriter.finish = TraceWriter.boundary = lambda *given: None
        return Decision(thought="replaced")


class Exit(Steady):
    async def act(self, observation, inbox):
        sys.exit(3)


class HardExit(Steady):
    async def act(self, observation, inbox):
        os._exit(0)


class Segfault(Steady):
    async def act(self, observation, inbox):
        ctypes.string_at(0)


class Kill(Steady):
    async def act(self, observation, inbox):
        os.killpg(0, signal.SIGKILL)


class Wrong(Steady):
    async def act(self, observation, inbox):
        return Decision(command=Action(verb="stop", arguments={"lock": threading.Lock()}))


class NoDecision(Steady):
    async def act(self, observation, inbox):
        return lambda: "a function"


class Raw(Steady):
    async def act(self, observation, inbox):
        for descriptor in range(3, 256):
            try:
                os.write(descriptor, b"\xff" * 64)
            except OSError:
                continue
        return Decision()


class Deep(Steady):
    """Sends a million lists in each other, past its host, which would refuse them."""

    async def act(self, observation, inbox):
        decision = {"thought": "", "messages": [{"kind": "report", "body": {"text": None}}]}
        whole = msgspec.msgpack.encode({"is": "DecisionMade", "decision": decision})
        _send(whole[:-1] + b"\x91" * 1_000_000 + b"\xc0")
        return Decision()


class Descriptors(Steady):
    """Sends many descriptors with each byte of a packet, on both of its channels."""

    async def act(self, observation, inbox):
        null = os.open(os.devnull, os.O_RDONLY)
        rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [null] * 50))]
        for end in _ends():
            for byte in struct.pack("<QB?", 10, 250, False)[:-1]:
                with suppress(OSError):
                    end.sendmsg([bytes([byte])], rights)
        return Decision()


def _ends():
    host = next(item for item in gc.get_objects() if type(item).__name__ == "_PolicyHost")
    return [socket.socket(fileno=os.dup(channel.fileno())) for channel in (host._channel, host._calls)]


def _send(payload):
    end = _ends()[0]
    end.setblocking(True)
    end.sendall(struct.pack("<QB?", len(payload), 0, False) + payload)


class Huge(Steady):
    async def act(self, observation, inbox):
        return Decision(messages=(Outgoing(kind="report", body={"text": "y" * 50_000_000}),))


class Flood(Steady):
    async def act(self, observation, inbox):
        for _ in range(20_000):
            print("\x1b[2J" + "y" * 100)
        return Decision(thought="printed")


class Forks(Steady):
    async def act(self, observation, inbox):
        subprocess.Popen(["setsid", "sh", "-c", "sleep 3600 & sleep 3600"])
        if os.fork() == 0:
            time.sleep(3600)
        return Decision(thought="forked")


class Threads(Steady):
    async def act(self, observation, inbox):
        threading.Thread(target=time.sleep, args=(3600,)).start()
        return Decision(thought="threads")


class Hog(Steady):
    async def act(self, observation, inbox):
        kept = []
        while True:
            kept.append(bytearray(b"x") * 10_000_000)


class Ambient(Steady):
    async def act(self, observation, inbox):
        draw = np.random.random
        order = list({"boat", "buoy", "pier", "raft", "rope"})
        return Decision(thought=f"{random.random()} {draw()} {hash('boat')} {order}")


class Regex(Steady):
    async def act(self, observation, inbox):
        os.nice(19)  # it computes until its deadline: other tests need the processor more
        re.match("(a+)+$", "a" * 60 + "b")


class Spin(Steady):
    async def act(self, observation, inbox):
        os.nice(19)
        while True:
            pass


class Sleep(Steady):
    async def act(self, observation, inbox):
        time.sleep(3600)


class Await(Steady):
    """Waits too long at its first turn, as for a service, and goes on with what it remembers."""

    async def act(self, observation, inbox):
        self.turns += 1
        if observation.tick == 0:
            await asyncio.sleep(3600)
        return Decision(thought=f"turn {self.turns}")


class Stop(Steady):
    async def act(self, observation, inbox):
        os.kill(os.getpid(), signal.SIGSTOP)


class Finaliser(Steady):
    class Slow:
        def __del__(self):
            time.sleep(3600)

    async def act(self, observation, inbox):
        self.slow = self.Slow()  # at the second turn the first one goes
        return Decision(thought="kept")


class Signals(Steady):
    """Refuses to end."""

    async def act(self, observation, inbox):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        asyncio.current_task().uncancel()
        while True:
            try:
                await asyncio.sleep(3600)
            except asyncio.CancelledError:
                continue


class SlowConstructor(Steady):
    def __init__(self):
        time.sleep(3600)


class BadReset(Steady):
    async def reset(self, brief):
        os._exit(9)


class Hoarder(Steady):
    """Fills pages and makes them read-only, so that RLIMIT_DATA does not count them."""

    async def act(self, observation, inbox):
        return self.hoard()

    def hoard(self):
        library = ctypes.CDLL(None, use_errno=True)
        library.mmap.restype = ctypes.c_void_p
        library.mmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long)
        library.mprotect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
        size, read, write, private, anonymous = 64 << 20, 1, 2, 2, 32
        for _ in range(16):
            place = library.mmap(None, size, read | write, private | anonymous, -1, 0)
            ctypes.memset(place, 1, size)
            assert library.mprotect(place, size, read) == 0
        time.sleep(60.0)  # far longer than until the next check, which ends this process
        return Decision(thought="1 GB")


class LateHoarder(Hoarder):
    """Answers at once, fills pages until its next turn, and waits for their end there."""

    filling = None

    async def act(self, observation, inbox):
        if self.filling is not None:
            self.filling.join()
        self.filling = threading.Thread(target=self.hoard, daemon=True)
        self.filling.start()
        return Decision()


class Inventor(Steady):
    """Writes a model call that it has not made into the record of calls."""

    async def act(self, observation, inbox):
        request = {"tick": 1, "number": 0, "head": b"{}", "messages": []}
        result = {"text": "done", "prompt_tokens": 1, "completion_tokens": 1}
        begin, end = {"is": "BeginModelCall", "request": request}, {"is": "EndModelCall", "request": request}
        for message in (begin, {**end, "result": result}):
            payload, calls = msgspec.msgpack.encode(message), _ends()[1]
            calls.setblocking(True)
            calls.sendall(struct.pack("<QB?", len(payload), 0, False) + payload)
            calls.recv(1)
        return Decision(thought="recorded")


class Processor(Steady):
    """Reads what libraries such as cpuinfo read, and changes it."""

    async def act(self, observation, inbox):
        from pathlib import Path

        text = Path("/proc/cpuinfo").read_text() + Path("/sys/devices/system/cpu/possible").read_text()
        with suppress(OSError):
            Path("/proc/cpuinfo").write_text("changed")
            text = "changed"
        return Decision(thought=text[:3000])
