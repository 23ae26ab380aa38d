"""The native part. Use the functions of the package `offbd`, which describe it."""

from typing import Any, final

__all__ = [
    "NativeEngine",
    "Table",
    "__version__",
    "calibrate",
    "read",
    "replay",
    "scene",
    "simulate",
]

__version__: str

@final
class Table:
    """A table of columns of equal length, with the Arrow PyCapsule interface."""

    def __new__(cls, bytes: bytes) -> Table: ...
    @property
    def column_names(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def to_pydict(self) -> dict[str, list[Any]]:
        """Returns the columns as lists."""

@final
class NativeEngine:
    def __new__(cls, asset_file: str | None, profile: str | None, session: str) -> NativeEngine: ...
    def add(self, recording: object) -> str: ...
    def add_sample(
        self,
        t_s: float,
        commands: tuple[float | None, float | None],
        position: tuple[float | None, float | None],
        seq: int | None,
    ) -> str: ...
    def summary(self) -> str: ...
    def state(self) -> tuple[str, bytes]: ...
    @staticmethod
    def of_state(version: str, state: bytes) -> NativeEngine: ...
    def end(self) -> tuple[str, str]: ...

def replay(
    recording: object,
    asset_file: str | None,
    profile: str | None,
    session: str | None,
    evidence: bool,
    columns: str | None,
    rate_hz: float | None,
) -> tuple[str, str, list[tuple[int, str]], int, Table | None]: ...
def calibrate(
    asset_file: str,
    recordings: list[Any],
    made_at: str,
    columns: str | None,
    rate_hz: float | None,
) -> str: ...
def read(
    recording: object,
    asset_file: str | None,
    columns: str | None,
    rate_hz: float | None,
) -> list[Table]: ...
def simulate(
    preset: str,
    rig_seed: int | None,
    asset_file: str | None,
    reference: str,
    seconds: float,
    seed: int,
    faults: list[str],
    seq: bool,
) -> tuple[str, Table]: ...
def scene(
    scene_file: str,
    model: str | None,
    method: str | None,
    step_s: float | None,
    tolerance_m: float,
    sample_s: float,
) -> tuple[str, str, Table]: ...
