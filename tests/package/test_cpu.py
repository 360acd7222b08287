"""The processor is checked before the core is loaded."""

from __future__ import annotations

import subprocess
import sys

import pytest

from usdmlt import Error, cpu, native


def test_a_processor_that_lacks_avx2_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cpu, "is_x86_64", lambda: True)
    monkeypatch.setattr(cpu, "features", lambda: frozenset(cpu.X86_64_V3) - {"avx2", "fma"})
    assert cpu.missing_features() == ["AVX2", "FMA"]
    with pytest.raises(Error, match="lacks AVX2, FMA") as caught:
        native.core()
    assert "\n" not in str(caught.value)


def test_other_architectures_need_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cpu, "is_x86_64", lambda: False)
    assert cpu.complaint() is None


def test_a_system_that_does_not_tell_is_given_the_benefit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cpu, "is_x86_64", lambda: True)
    monkeypatch.setattr(cpu, "features", lambda: None)
    assert cpu.complaint() is None


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc/cpuinfo")
def test_importing_on_an_old_processor_warns_once(tmp_path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor\t: 0\nmodel name\t: Old\nflags\t\t: fpu sse2 avx\n\n")
    code = f"""
import builtins, warnings
really_open = builtins.open
builtins.open = lambda path, *a, **k: really_open(
    {str(cpuinfo)!r} if path == "/proc/cpuinfo" else path, *a, **k)
import usdmlt
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    if cpu.is_x86_64():
        assert done.stderr.count("this processor lacks AVX2, BMI1") == 1
