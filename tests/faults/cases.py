"""A planted fault, and what is left of the command that met it."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Injection:
    """A case: what is played, and the call that fails. `number` 0: none does."""

    target: str
    kind: str = "open"
    number: int = 0
    error: str = "EIO"
    lasting: bool = False

    @property
    def line(self) -> str:
        """The command that plays it again."""
        lasting = " --lasting" if self.lasting else ""
        return f"python -m tests.faults.again {self.target} {self.kind} {self.number} {self.error}{lasting}"


@dataclass
class Aftermath:
    """What a case has left: exit code, output, counted calls, processes and files, and what is wrong with all that."""

    code: int
    output: str
    errors: str
    counts: dict[str, int]
    orphans: list[str]
    left: list[str]
    faults: list[str] = field(default_factory=list)
