"""The compiled core. Use it through :mod:`usdmlt.native`. Probes for tests are left out here."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

class Scene:
    """A scene with its acceleration structures; immutable."""

    def __init__(self, scene: Any, embree_library: str, isa: str = "avx2") -> None: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def has_lights(self) -> bool: ...
    @property
    def dirac_lights(self) -> list[int]: ...
    @property
    def dirac_materials(self) -> list[int]: ...
    @property
    def has_motion(self) -> bool: ...
    def intersect(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, time: float = 0
    ) -> dict[str, npt.NDArray[Any]]: ...

def surface_layers(
    scene: Scene,
    asked: set[str],
    *,
    filter: str = "gaussian",
    samples: int = 1,
    ranks: int = 1,
    threads: int = 1,
    poll: Callable[[int], bool] | None = None,
) -> dict[str, npt.NDArray[Any]]: ...

class Render:
    """A plan, and the film that its units add to."""

    def __init__(
        self,
        scene: Scene,
        *,
        integrator: str = "path",
        samples: int = 64,
        depth: int = 16,
        seed: int = 0,
        filter: str = "gaussian",
        min_edges: int = 1,
        background: bool = True,
        direct: str = "auto",
        two_stage: bool = True,
        mutation_weights: Mapping[str, float] = ...,
        error_layer: bool = True,
        reduction: int = 1,
        selective: bool = True,
        layers: Any = None,
    ) -> None: ...
    @property
    def units_total(self) -> int: ...
    @property
    def units_done(self) -> int: ...
    @property
    def samples_per_unit(self) -> float: ...
    def run(
        self,
        last_unit: int,
        threads: int = 1,
        deadline_seconds: float | None = None,
        poll: Callable[[int], bool] | None = None,
    ) -> int: ...
    def again(self, seed: int, samples: int) -> Render: ...
    def image(self) -> npt.NDArray[np.float32]: ...
    def error(self) -> npt.NDArray[np.float32]: ...
    def layer(self, index: int) -> npt.NDArray[np.float32]: ...
    def sums(self, layer: int = -1) -> npt.NDArray[np.int64]: ...
    def sample_counts(self) -> npt.NDArray[np.uint32]: ...
    def stats(self) -> dict[str, Any]: ...
    def replay_rays_per_cpu_second(self, count: int = 1000000) -> float: ...

plain_mutations: tuple[str, ...]

def plain_metropolis(
    f: npt.NDArray[np.float64],
    *,
    weights: Sequence[float],
    chains: int,
    steps: int,
    seed: int,
    smallest_step: float,
    largest_step: float,
    forget_density: bool = False,
) -> dict[str, Any]: ...
def build_info() -> dict[str, Any]: ...
def embree_version(library: str) -> str: ...
def embree_instance_levels(library: str, limit: int = 4) -> int: ...
