"""Keeping machine code that Numba has made: a file is written, and loaded by llvmlite alone."""

import contextlib
import ctypes
import hashlib
import json
import os
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
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}")
    part.write_bytes(json.dumps(head).encode() + b"\n" + code)
    part.replace(path)


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
