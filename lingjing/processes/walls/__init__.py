"""Walls around a process with foreign code: it reaches its own files, its own channels, and nothing else.

The concepts:

- A *promise* is one sentence about the process behind the walls, such as "no network" (`report.PROMISES`).
- A *guard* is a mechanism of the kernel that keeps promises: namespaces, Landlock, seccomp, resource limits. Several
  guards may keep one promise. A promise is broken if none of its guards is there.
- The process builds its walls itself, before it executes foreign code, and cannot take them down. It then reports the
  guards (`report.WallReport`), so that the other side knows the broken promises.

In the order of a start:

- `namespaces`     the user and process-id namespaces of a fork server, before it forks anything
- `entering`       `enter`: all steps in a forked process, in their order
- `file_system`    a root of read-only mounts and one scratch folder
- `landlock`, `seccomp`   rules for files, sockets and signals; a filter of system calls
- `readable`       the files of Python's installed packages, without the other files of a project's folder
- `offer`          the walls that this kernel offers, as `lingjing doctor` reports them
- `report`         promises, guards and the report
- `system_calls`   the system calls themselves

Linux only; the filter of system calls exists for x86-64 and AArch64.
"""
