"""What the compiled core asks of the processor, found out without running it.

The default build is for x86-64-v3 (AVX2 and what came with it); on arm64 it is the baseline.
"""

from __future__ import annotations

import ctypes
import platform
import sys

# The level is defined by the x86-64 psABI; names as Linux prints them (`abm` stands for LZCNT).
X86_64_V3 = ("avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe")


def is_x86_64() -> bool:
    """Whether this is a 64-bit x86 process."""
    return platform.machine().lower() in ("x86_64", "amd64")


def features() -> frozenset[str] | None:
    """Features of this processor, or None where the system does not tell.

    Linux lists them all. Windows and macOS are asked for AVX2 only, which in every processor made
    came together with the rest of x86-64-v3.
    """
    if sys.platform == "linux":
        return _linux_flags()
    if sys.platform == "win32":
        avx2_instructions_available = 40  # PF_AVX2_INSTRUCTIONS_AVAILABLE
        kernel = ctypes.windll.kernel32
        return _all_if(kernel.IsProcessorFeaturePresent(avx2_instructions_available))
    if sys.platform == "darwin":
        return _all_if(_macos_flag(b"hw.optional.avx2_0"))
    return None


def missing_features() -> list[str]:
    """Features that the default build needs and this processor lacks, in upper case."""
    available = features() if is_x86_64() else None
    if not available:
        return [] if available is None else [name.upper() for name in X86_64_V3]
    return [name.upper() for name in X86_64_V3 if name not in available]


def complaint() -> str | None:
    """One line that says what the processor lacks; None when nothing is."""
    missing = missing_features()
    if not missing:
        return None
    return (
        f"this processor lacks {', '.join(missing)}, which this build of usdmlt needs "
        "(x86-64-v3: Intel since 2013, AMD since 2015): it cannot render"
    )


def model_name() -> str:
    """The processor's name, for people."""
    if sys.platform == "linux":
        return _linux_cpuinfo().get("model name", platform.machine())
    return platform.processor() or platform.machine()


def _all_if(has_avx2: bool) -> frozenset[str]:
    return frozenset(X86_64_V3) if has_avx2 else frozenset()


def _linux_flags() -> frozenset[str] | None:
    flags = _linux_cpuinfo().get("flags")
    return None if flags is None else frozenset(flags.split())


def _linux_cpuinfo() -> dict[str, str]:
    """The fields of the first processor: the file is long on machines with many."""
    fields: dict[str, str] = {}
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if not line.strip():
                    break
                key, _, value = line.partition(":")
                fields[key.strip()] = value.strip()
    except OSError:
        pass
    return fields


def _macos_flag(name: bytes) -> bool:
    libc = ctypes.CDLL(None)
    value = ctypes.c_int(0)
    size = ctypes.c_size_t(ctypes.sizeof(value))
    failed = libc.sysctlbyname(name, ctypes.byref(value), ctypes.byref(size), None, 0)
    return not failed and value.value != 0
