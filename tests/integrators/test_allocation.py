"""No memory is allocated while chains run, or per ray: an allocator that counts is laid under a
process that renders few units, and many."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from support.rendering import ALL

COUNTER = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
static unsigned long long count;
unsigned long long allocations(void) { return __atomic_load_n(&count, __ATOMIC_RELAXED); }
extern void *__libc_malloc(size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
static void note(void) { __atomic_fetch_add(&count, 1, __ATOMIC_RELAXED); }
void *malloc(size_t n) { note(); return __libc_malloc(n); }
void *realloc(void *p, size_t n) { note(); return __libc_realloc(p, n); }
void *aligned_alloc(size_t a, size_t n) { note(); return __libc_memalign(a, n); }
int posix_memalign(void **p, size_t a, size_t n) {
    note();
    *p = __libc_memalign(a, n);
    return *p ? 0 : 12;
}
"""

PROGRAM = """
import ctypes, sys
from support import scenes
from support.rendering import plan
from usdmlt.layers import resolve
from usdmlt.light_path_layers import compiled_for
allocations = ctypes.CDLL(None).allocations
allocations.restype = ctypes.c_ulonglong
integrator, samples, asked = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
scene = scenes.build("layers" if asked else "smooth_glass")
layers = compiled_for(scene, resolve(asked)) if asked else None
render = plan(scene, integrator, samples=samples, depth=8, layers=layers)
n = render.units_total // 4
def count(last):
    before, rays = allocations(), render.stats()["rays"]
    render.run(last)
    return allocations() - before, render.stats()["rays"] - rays
few = count(n)
many = count(4 * n)
print(many[0] - few[0], many[1] - few[1], 2 * n)
"""


@pytest.fixture(scope="module")
def counter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs Linux and a C compiler")
    folder = tmp_path_factory.mktemp("counter")
    (folder / "counter.c").write_text(COUNTER)
    library = folder / "counter.so"
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-O1", "-fno-builtin", "-o", library, folder / "counter.c"],
        check=True,
    )
    return library


@pytest.mark.parametrize("layers", [[], ["LS+DE", "diffuse", "specular", "C.*<L.'key'>"]])
@pytest.mark.parametrize("integrator", ALL)
def test_nothing_is_allocated_per_ray(counter: Path, integrator: str, layers: list[str]) -> None:
    """Less than one allocation in a thousand rays is what units do: it is not what rays, paths or
    mutations do."""
    here = Path(__file__).parents[1]
    environment = {**os.environ, "LD_PRELOAD": str(counter)}
    environment["PYTHONPATH"] = os.pathsep.join([str(here), *filter(None, sys.path)])
    samples = "1024" if integrator == "mlt" else "512"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, integrator, samples, *layers],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    allocated, rays, units = map(int, done.stdout.split())
    print(f"{integrator}: {allocated} allocations, {rays} rays, {units} units")
    assert rays > 100_000
    assert allocated < rays / 1000
