"""A planted fault, and the state that a command with this fault leaves."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Injection:
    """A case: the command that is played, and the call that fails there: the n-th of a kind at a place
    (`injector`). Without a kind none does."""

    target: str
    kind: str = ""
    place: str = ""
    number: int = 0
    error: str = "EIO"
    lasting: bool = False

    @property
    def line(self) -> str:
        """The command that plays it again."""
        lasting = " --lasting" if self.lasting else ""
        words = f"{self.target} {self.kind} {self.place} {self.number} {self.error}"
        return f"python -m tests.faults.again {words}{lasting}"


@dataclass
class Aftermath:
    """The state after a case.

    `calls` has a line for each planted call that was made (each call if none was planted), `faults` lists what is
    wrong.
    """

    code: int
    output: str
    errors: str
    calls: list[str]
    orphans: list[str]
    left: list[str]
    faults: list[str] = field(default_factory=list)
