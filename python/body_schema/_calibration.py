"""Tables that are calibrated, and robots that are looked at before anything is measured."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from . import _engine
from ._commands import write_all
from ._errors import wrong
from ._progress import Progress, hearing
from ._tables import axes, dataframe, short_table
from ._words import by_name, kept, positions, written
from .answers import CalibrationReport, Observability

Posture = Mapping[str, float] | Sequence[float]


class Calibration:
    """What ``calibrate`` found: the report, the files, and the robot as described (*nominal*) and as learned.

    Poses and Jacobians are in the frame of the measurements, metres and radians.
    """

    def __init__(self, engine: _engine.Calibrated) -> None:
        self._engine = engine
        self._report: CalibrationReport = json.loads(engine.report())

    @property
    def joints(self) -> list[str]:
        """The names of the joints of a posture, in its order."""
        return self._engine.joints()

    @property
    def report(self) -> CalibrationReport:
        """The content of ``report.json``."""
        return self._report

    @property
    def guesses(self) -> list[str]:
        """What had to be guessed of a URDF and a table, a sentence each."""
        return self._engine.guesses()

    @property
    def files(self) -> dict[str, str]:
        """The files that ``body-schema calibrate`` writes, by path, but for pages and pictures."""
        return dict(self._engine.files())

    def to_urdf(self, path: str | PathLike[str] | None = None) -> str:
        """The corrected URDF; written to ``path`` too, if one is given."""
        files = self.files
        if "calibrated.urdf" not in files:
            raise wrong("robot", "it is not described by a URDF", "calibrate one that is")
        return kept(files["calibrated.urdf"], path)

    def write(self, folder: str | PathLike[str]) -> list[Path]:
        """Write all ``files`` into a folder that is empty or not there yet, and give their paths."""
        folder = Path(folder)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise wrong("folder", f"{folder} is there already, and not empty", "name another")
        files: dict[Path, str | bytes] = {folder / name: text for name, text in self.files.items()}
        write_all(files, force=False)
        return list(files)

    def dataframe(self, part: str = "residuals") -> Any:
        """A list of the report as a ``pandas.DataFrame``, a row for each of its entries (needs pandas): ``residuals``, ``joints``, ``outliers``,
        ``noise``, ``targets``, ``extras``, ``correlations``, … Nested numbers are columns ``outer.inner``."""
        return dataframe(self._report, part)

    def joints_dataframe(self) -> Any:
        """The learned joints, a row each: ``dataframe("joints")``."""
        return self.dataframe("joints")

    def outliers_dataframe(self) -> Any:
        """The rows that are likelier outliers than not: ``dataframe("outliers")``."""
        return self.dataframe("outliers")

    def _readings(self, posture: Posture) -> list[float]:
        joints = self.joints
        return positions(by_name(posture, None if isinstance(posture, Mapping) else joints, joints), joints)

    def fk(self, posture: Posture, *, nominal: bool = False, of: str | None = None) -> list[list[float]]:
        """The pose of the hand, or of the target or camera ``of``, at a posture: 4 x 4, homogeneous.

        ``posture`` has a position for each of ``joints``, rad or m, by name or in their order.
        """
        return self._engine.fk(self._readings(posture), nominal, of)

    def jacobian(self, posture: Posture, *, nominal: bool = False, of: str | None = None) -> list[list[float]]:
        """The Jacobian of that pose by the joints' readings: 6 x n, the velocity of its origin, then its angular velocity."""
        return self._engine.jacobian(self._readings(posture), nominal, of)

    def covariance(self, posture: Posture, *, of: str | None = None, reading: bool = False) -> list[list[float]]:
        """The covariance of the predicted position of the hand, or of the target or camera ``of``, at a posture, 3 x 3, m^2, as far as parameters
        are uncertain.

        With ``reading`` it is that of a reading of the target ``of``, whose noise s is known as well as the rows tell it: s^2 is added, and all
        is n / (n - 2) times as much, n = ``degrees`` / ``shared`` + 3 (Student's distribution). Where the model leaves more than noise,
        ``report["widened"]`` says by which factor deviations are to be widened.
        """
        covariance = self._engine.covariance(self._readings(posture), of)
        if not reading:
            return covariance
        measured = {it["sensor"]: it for it in self._report["noise"] if it["unit"] == "m"}
        noise = next(iter(measured.values()), None) if of is None and len(measured) == 1 else measured.get(of or "")
        if noise is None:
            names = ", ".join(measured) or "none"
            raise wrong("of", f"no position of {of or 'the hand'} was measured", f"name a target whose position was: {names}")
        variance = (noise["explaining_sigma"] or noise["sigma"]) ** 2
        degrees = noise["degrees"] / noise.get("shared", 1.0)
        student = (degrees + 3) / (degrees + 1)
        return [[student * (it + variance * (i == j)) for j, it in enumerate(row)] for i, row in enumerate(covariance)]

    def _rows(self) -> list[tuple[str, object]]:
        report, unit = self._report, self._report["unit"]
        figures = report["held_out"] or report["training"]
        rows = "held-out" if report["held_out"] else "training"
        means = {"before": figures["before"], "after": figures["after"]}
        mean = {when: dict[str, Any](its)[f"mean_{unit}"] for when, its in means.items()}
        told = {when: "none" if value is None else f"{value:.3g} {unit}" for when, value in mean.items()}
        return [
            ("calibration", report["scenario"]),
            ("joints", ", ".join(self.joints)),
            (f"mean error on {rows} rows", f"{told['before']} nominal, {told['after']} calibrated"),
        ]

    def plot(self, ax: Any = None) -> Any:
        """What the calibrated robot misses every reading by, by its row, held-out and training rows apart. Gives the axes. Needs matplotlib."""
        ax = axes(ax)
        unit = self._report["unit"]
        for held_out, label in ((True, "held out"), (False, "learned from")):
            its = [it for it in self._report["residuals"] if it["held_out"] is held_out]
            errors = [(it["row"], dict[str, Any](it)[f"residual_{unit}"]) for it in its if dict[str, Any](it).get(f"residual_{unit}") is not None]
            if errors:
                ax.plot([row for row, _ in errors], [error for _, error in errors], ".", label=label)
        ax.set(xlabel="row", ylabel=f"error, {unit}", title=self._report["scenario"])
        ax.set_ylim(bottom=0)
        ax.legend(frameon=False)
        return ax

    def __copy__(self) -> Calibration:
        return self

    def __deepcopy__(self, memo: object) -> Calibration:
        # Nothing of it changes.
        return self

    def __reduce__(self) -> str:
        raise TypeError("a calibration is not pickled: keep its `files` and `report`, which are plain text and dicts, or `write` it to a folder")

    def __repr__(self) -> str:
        return "<" + "; ".join(f"{head} {it}" for head, it in self._rows()) + ">"

    def _repr_html_(self) -> str:
        return short_table(self._rows())


def calibrate(
    file: str | PathLike[str],
    table: str | PathLike[str] | Any | None = None,
    *,
    base: str | None = None,
    tip: str | None = None,
    on: Mapping[str, str] | None = None,
    tag_side_m: float | None = None,
    socket_distance_m: float | None = None,
    folds: int | None = None,
    active: int | None = None,
    progress: Progress = None,
    **keys: Any,
) -> Calibration:
    """Calibrate a robot from a table: ``calibrate("robot.urdf", "rows.csv")``, or ``calibrate("rows.toml")`` of a calibration file.

    A table may be a ``pandas.DataFrame``, whose columns are titled as those of a file. With a table the calibration file is made as ``body-schema init`` makes it, with ``base``, ``tip``, ``on`` (the links that carry
    targets and cameras, by the names of these), ``tag_side_m`` and ``socket_distance_m`` as there; ``guesses`` says what had to be guessed.
    ``keys`` stand in place of those of that file, tables key by key, ``held_out`` as a whole: ``prior={"direction_rad": 0.02}``,
    ``robot={"learn": "zeros"}``, ``base_={"at_m": …}`` for its table ``[base]``; files that they name lie beside the URDF. ``folds`` and
    ``active`` are those of ``body-schema calibrate``. ``progress`` hears how far it is, as that of ``Session.report`` does, and Ctrl-C ends
    it. Raises ``FieldError`` or ``EngineError``.
    """
    if table is None:
        for name, given in (("base", base), ("tip", tip), ("on", on), ("tag_side_m", tag_side_m), ("socket_distance_m", socket_distance_m)):
            if given is not None:
                raise wrong(name, "a calibration file says it", "write it there, or pass a URDF and a table")
        for name in keys:
            raise wrong(name, "a calibration file says it", "write it there, or pass a URDF and a table")
    for section, key in (("measurements", "file"), ("robot", "urdf")):
        if key in keys.get(section, {}):
            raise wrong(f"{section}.{key}", "the URDF and the table are arguments", "leave the key out")
    if "base_" in keys:
        keys["base"] = keys.pop("base_")
    with hearing(progress) as hear, TemporaryDirectory() as folder:
        if hasattr(table, "to_csv"):
            frame: Any = table
            table = Path(folder) / "rows.csv"
            frame.to_csv(table, index=False)
        paths = fspath(file), None if table is None else fspath(table)
        carriers = list((on or {}).items())
        own = written("keys", keys)
        engine = _engine.calibrate_table(*paths, base, tip, carriers, tag_side_m, socket_distance_m, folds, active, hear, own)
        return Calibration(engine)


def observability(
    file: str | PathLike[str], *, postures: int = 30, accuracy_m: float | None = None
) -> Observability:
    """What movements can determine, before anything is measured: what ``body-schema observability --json`` writes.

    ``file`` is a scenario or calibration file, with or without a table, or a built-in scenario. ``dataframe(answer, "errors")``
    and its other lists are tables.
    """
    answer: Observability = json.loads(_engine.observability(fspath(file), postures, accuracy_m))
    return answer
