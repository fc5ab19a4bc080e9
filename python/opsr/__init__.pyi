"""Types of the package. The docstrings of the functions say shapes, units, ranges and errors: `help(opsr.render)`."""

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

Path = str | os.PathLike[str]
Picture = NDArray[np.float32]
"""height x width x 3, rows from the top: linear Rec. 709 radiance."""

__version__: str

class Scene:
    @staticmethod
    def load(
        path: Path,
        env: Path | None = None,
        *,
        env_intensity: float = 1.0,
        env_rotation: float = 0.0,
        distribution: Literal["beckmann", "ggx"] = "beckmann",
        solid_glass: bool = False,
    ) -> Scene: ...
    @property
    def cameras(self) -> list[str]: ...
    @property
    def path(self) -> os.PathLike[str]: ...
    @property
    def sha256(self) -> str: ...
    @property
    def warnings(self) -> list[str]: ...

class Table:
    def __init__(
        self,
        gammas: ArrayLike,
        *,
        interpolation: Literal["nearest", "linear"] = "nearest",
        scale: float = 1.0,
    ) -> None: ...
    @staticmethod
    def load(path: Path) -> Table: ...
    @staticmethod
    def constant(gamma: float) -> Table: ...
    def save(self, path: Path) -> None: ...
    @overload
    def lookup(self, alphas: Sequence[float]) -> float: ...
    @overload
    def lookup(self, alphas: ArrayLike) -> float | NDArray[np.float32]: ...
    def tuned(self, scale: float = 1.0, contrast: float = 1.0) -> Table: ...
    @property
    def gammas(self) -> NDArray[np.float32]: ...
    @property
    def interpolation(self) -> Literal["nearest", "linear"]: ...
    @property
    def scale(self) -> float: ...
    @property
    def sha256(self) -> str: ...
    @property
    def provenance(self) -> dict[str, Any] | None: ...

class Progress:
    @property
    def samples(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    @property
    def fraction(self) -> float: ...

class Film:
    @property
    def picture(self) -> Picture: ...
    @property
    def variance(self) -> Picture: ...
    @property
    def aovs(self) -> dict[str, NDArray[np.float32]]: ...
    @property
    def levels(self) -> NDArray[np.float32] | None: ...
    @property
    def samples(self) -> NDArray[np.uint32]: ...
    @property
    def rejected(self) -> int: ...
    @property
    def relative_error(self) -> float: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def crop(self) -> tuple[int, int, int, int]: ...
    @property
    def spp(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    def save(self, path: Path, *, exposure: float | None = None) -> None: ...

class Resolved:
    @property
    def picture(self) -> Picture: ...
    @property
    def level(self) -> NDArray[np.uint8]: ...
    @property
    def bias2(self) -> NDArray[np.float32]: ...
    @property
    def variance(self) -> NDArray[np.float32]: ...
    @property
    def error(self) -> NDArray[np.float32]: ...
    @property
    def relative_error(self) -> float: ...

class Step:
    @property
    def beta(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def loss(self) -> float: ...
    @property
    def log(self) -> dict[str, Any] | None: ...

@overload
def render(
    scene: Scene,
    *,
    camera: str | int | None = None,
    size: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int = 0,
    table: Table | Path | None = None,
    table_scale: float | Literal["auto"] | None = None,
    gamma: float | None = None,
    rule: Literal["pbrt", "filter-glossy", "roughness-clamp", "mollifier"] | None = None,
    filter: float | None = None,
    reuse: bool = False,
    consistent: float | None = None,
    integrator: str = "path",
    levels: int | Sequence[float] | None = None,
    max_vertices: int = 16,
    sampler: str = "sobol",
    threads: int | None = None,
    aov: bool | str | Sequence[str] | None = None,
    on_progress: Callable[[Progress], bool | None] | None = None,
    part: None = None,
    samples: None = None,
) -> Film: ...
@overload
def render(
    scene: Scene,
    *,
    camera: str | int | None = None,
    size: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int = 0,
    table: Table | Path | None = None,
    table_scale: float | Literal["auto"] | None = None,
    gamma: float | None = None,
    rule: Literal["pbrt", "filter-glossy", "roughness-clamp", "mollifier"] | None = None,
    filter: float | None = None,
    reuse: bool = False,
    consistent: float | None = None,
    integrator: str = "path",
    levels: int | Sequence[float] | None = None,
    max_vertices: int = 16,
    sampler: str = "sobol",
    threads: int | None = None,
    aov: bool | str | Sequence[str] | None = None,
    on_progress: Callable[[Progress], bool | None] | None = None,
    part: Path,
    samples: tuple[int, int] | None = None,
) -> None: ...
def merge(
    parts: Sequence[Path], *, spp: int | None = None, crop: tuple[int, int, int, int] | None = None
) -> Film: ...
def resolve(film: Film, *, robust: bool = False, sigma: float = 0.7) -> Resolved: ...
def compare(
    picture: Film | Picture | Path,
    reference: Film | Picture | Path,
    *,
    ppd: float | None = None,
    exposure: float = 0.0,
) -> dict[str, float]: ...
def train(
    config: dict[str, Any] | Path | None = None,
    *,
    on_step: Callable[[Step], bool | None] | None = None,
    threads: int | None = None,
) -> list[Table]: ...
