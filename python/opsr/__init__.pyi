"""Types of the package. The docstrings of the functions say shapes, units, ranges and errors: `help(opsr.render)`."""

import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, TypedDict, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack

Path = str | os.PathLike[str]
Picture = NDArray[np.float32]
"""height x width x 3, rows from the top: linear Rec. 709 radiance."""

__version__: str

class _SceneOptions(TypedDict, total=False):
    """Options of `Scene.load` beside `env`."""

    sun: Sequence[float] | str | None
    env_intensity: float | None
    env_rotation: float | None
    distribution: Literal["beckmann", "ggx"] | None
    unsupported: Literal["error", "nearest", "skip"] | None
    glass: Literal["solid", "thin"] | None
    variant: str | int | None
    at: str | None

class Scene:
    @staticmethod
    def load(path: Path, env: Path | None = None, *, name: Path | None = None, **options: Unpack[_SceneOptions]) -> Scene: ...
    @staticmethod
    def build(
        meshes: Iterable[dict[str, Any]],
        *,
        lights: Iterable[dict[str, Any]] | None = None,
        cameras: Iterable[dict[str, Any]] | None = None,
        environment: ArrayLike | None = None,
        medium: dict[str, Any] | None = None,
    ) -> Scene: ...
    def changed(
        self,
        *,
        cameras: Iterable[dict[str, Any]] | None = None,
        lights: Iterable[dict[str, Any]] | None = None,
        materials: dict[str | int, dict[str, Any]] | None = None,
        environment: ArrayLike | None = None,
    ) -> Scene: ...
    @property
    def cameras(self) -> list[str]: ...
    @property
    def materials(self) -> list[str]: ...
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
    def tuned(self, scale: float) -> Table: ...
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
    def mean_relative_error(self) -> float: ...
    @property
    def relative_error(self) -> float: ...
    @property
    def error_bound(self) -> float: ...
    @property
    def mean_error(self) -> tuple[float, float, float] | None: ...
    @property
    def light_missing(self) -> float: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def crop(self) -> tuple[int, int, int, int]: ...
    @property
    def spp(self) -> int: ...
    @property
    def seconds(self) -> float: ...
    @property
    def metadata(self) -> dict[str, str]: ...
    def save(self, path: Path, **options: Unpack[_SaveOptions]) -> None: ...
    def _repr_png_(self) -> bytes: ...

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
    def mean_relative_error(self) -> float: ...
    @property
    def relative_error(self) -> float: ...
    def _repr_png_(self) -> bytes: ...

class View:
    @property
    def address(self) -> str: ...
    def close(self) -> None: ...
    def _repr_html_(self) -> str: ...

class Step:
    @property
    def beta(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def loss(self) -> float: ...
    @property
    def log(self) -> dict[str, Any] | None: ...

class _Options(TypedDict, total=False):
    """Options of `render`."""

    size: tuple[int, int] | str | None
    crop: tuple[int, int, int, int] | str | None
    camera: str | int | Path | None
    lens: tuple[float, float] | float | None
    spp: int | None
    time: float | None
    target_error: float | None
    integrator: Literal["path", "guided", "manifold", "light", "bdpt", "vcm", "sppm", "mlt", "auto"] | None
    table: Table | Path | float | None
    resolve: Literal["raw", "none", "sharp", "default"] | None
    max_vertices: int | None
    seed: int | None
    levels: int | str | Sequence[float] | None
    table_scale: float | None
    lookup: Literal["nearest", "linear"] | None
    mode: Literal["default", "reuse", "pbrt", "filter-glossy", "roughness-clamp", "mollifier"] | None
    consistent: float | None
    filter: float | None
    unbiased: bool | None
    trials: int | None
    radius: float | None
    radius_alpha: float | None
    connections: Literal["all", "nee"] | None
    mlt_pass: int | None
    strategy: tuple[int, int] | str | None
    sampler: Literal["independent", "sobol"] | None
    aov: bool | str | Sequence[str] | None
    denoise: bool | None
    on_progress: Callable[[Progress], bool | None] | None
    threads: int | None

class _SaveOptions(TypedDict, total=False):
    """Options of `Film.save`."""

    exposure: float | str | None
    view: Literal["srgb", "filmic", "agx"] | None
    exr: str | None

class _ViewOptions(_Options, total=False):
    """Options of `view`: those of `render` and of `Scene.load`, and what is shown."""

    env: Path | None
    env_intensity: float | None
    env_rotation: float | None
    exposure: float | str | None
    view: Literal["srgb", "filmic", "agx"] | None

@overload
def render(
    scene: Scene, *, part: None = None, samples: None = None, begun: None = None, **options: Unpack[_Options]
) -> Film: ...
@overload
def render(
    scene: Scene,
    *,
    part: Path,
    samples: tuple[int, int] | None = None,
    begun: Path | None = None,
    **options: Unpack[_Options],
) -> None: ...
def choose(scene: Scene, **options: Unpack[_Options]) -> dict[str, Any]: ...
def merge(
    parts: Sequence[Path],
    *,
    spp: int | None = None,
    crop: tuple[int, int, int, int] | None = None,
    partial: bool = False,
) -> Film: ...
def resolve(film: Film, *, resolve: Literal["none", "sharp", "default"] = "default") -> Resolved: ...
def view(
    scene: Scene | Path,
    *,
    port: int = 0,
    height: int = 640,
    reference: Path | None = None,
    **options: Unpack[_ViewOptions],
) -> View: ...
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
    recordings: Path | None = None,
    threads: int | None = None,
) -> list[Table]: ...
def record(
    config: dict[str, Any] | Path | None,
    folder: Path,
    *,
    crops: tuple[int, int] | None = None,
    threads: int | None = None,
) -> list[dict[str, Any]]: ...
def bench(
    suite: Path,
    output: Path,
    *,
    scenes: Sequence[str] | None = None,
    on_progress: Callable[[str, int, int], bool | None] | None = None,
    threads: int | None = None,
) -> dict[str, Any]: ...
