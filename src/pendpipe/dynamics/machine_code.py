"""Keeping machine code that Numba has made: a file is written, and loaded by llvmlite alone."""

import contextlib
import ctypes
import hashlib
import json
import os
import stat
from pathlib import Path
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import llvmlite.binding as llvm  # type: ignore[import-untyped]

# What LLVM itself may call for, besides what the code declares.
_LIBRARY = ("ceil", "cos", "exp", "log", "memcpy", "memmove", "memset", "sin")


def platform() -> str:
    """Return what the code depends on besides its source."""
    features = llvm.get_host_cpu_features().flatten()
    return (
        f"{llvmlite.__version__} {llvm.get_default_triple()} {llvm.get_host_cpu_name()} {features}"
    )


PORTABLE = {
    "x86_64": {
        "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
        "x86-64": (),
    }
}
"""By architecture: processors for which code is shipped, the fastest first; what they can do."""


def processors() -> dict[str, tuple[str, ...]]:
    """Return for which processors code made here can be shipped, and what they can do."""
    return PORTABLE.get(llvm.get_default_triple().partition("-")[0], {})


def _target_machine(processor: str = "") -> Any:
    """Return LLVM's idea of a processor that `PORTABLE` names, or of this machine."""
    with contextlib.suppress(RuntimeError):  # newer versions have done it already, and warn
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = "" if processor else llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=processor or llvm.get_host_cpu_name(), features=features, opt=3, jit=True
    )


def keep(path: Path, assembly: str, name: str, processor: str = "") -> None:
    """Write the machine code of a module, with its function that will be called, to `path`."""
    module = llvm.parse_assembly(assembly)
    declared = [
        function.name
        for function in module.functions
        if function.is_declaration and not function.name.startswith("llvm.")
    ]
    code = _target_machine(processor).emit_object(module)
    head = {
        "name": name,
        "needs": declared,
        "digest": hashlib.blake2b(code).hexdigest(),
        "triple": llvm.get_default_triple(),
        "features": processors().get(processor, ()),
    }
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}")
    part.write_bytes(json.dumps(head).encode() + b"\n" + code)
    part.replace(path)


def distrusted(path: Path) -> str:
    """Say why code in a file may not be ours: who can write it runs what he likes in our name.

    File, folder and the folders above must belong to the user or to root, and nobody else may
    write them. A folder above may be sticky, as ``/tmp`` is: there nobody moves what is others'.
    What is not there is trusted; on Windows, where the mode tells nothing, everything.
    """
    folder = path.parent.resolve()
    for place in (folder / path.name, folder, *folder.parents) if os.name != "nt" else ():
        try:
            status = place.lstat()
        except OSError:
            continue
        sticky = place in folder.parents and status.st_mode & stat.S_ISVTX
        for wrong, why in (
            (place.name == path.name and not stat.S_ISREG(status.st_mode), "is no plain file"),
            (status.st_uid not in (0, os.geteuid()), "belongs to another user"),
            (_others_write(status) and not sticky, "can be written by others"),
        ):
            if wrong:
                return f"{place} {why}"
    return ""


def _others_write(status: os.stat_result) -> bool:
    """Whether its group or all may write; a group that has its owner's name is his alone."""
    if not status.st_mode & stat.S_IWGRP or status.st_mode & stat.S_IWOTH:
        return bool(status.st_mode & stat.S_IWOTH)
    import grp
    import pwd

    try:
        owner, group = pwd.getpwuid(status.st_uid).pw_name, grp.getgrgid(status.st_gid)
    except KeyError:
        return True
    return group.gr_name != owner or not {*group.gr_mem} <= {owner}


def load(path: Path) -> tuple[int, Any] | None:
    """Return the address of the function kept in `path`, and what must stay alive with it.

    None if there is no such file, or it is damaged, or this process lacks what it needs.
    """
    try:
        line, code = path.read_bytes().split(b"\n", 1)
        head = json.loads(line)
        needed, name = {*_LIBRARY, *head["needs"]}, head["name"]
        sound = hashlib.blake2b(code).hexdigest() == head["digest"]
        host = llvm.get_host_cpu_features()
        sound = sound and head["triple"] == llvm.get_default_triple()
        sound = sound and all(host.get(feature) for feature in head["features"])
    except (OSError, ValueError, KeyError):
        return None
    if not sound:
        return None
    machine = _target_machine()
    with contextlib.suppress(AttributeError):
        for each in needed:
            _provide(each)
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        return engine.get_function_address(name), engine
    return None


def _provide(name: str) -> None:
    """Give LLVM the address of a function; AttributeError if the C library lacks it."""
    if llvm.address_of_symbol(name) is None:
        library = ctypes.cdll.ucrtbase if os.name == "nt" else ctypes.CDLL(None)
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
