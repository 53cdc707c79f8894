"""Sessions of one's own, computed here."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any

from ._engine import Engine, setup_of_file, setup_of_urdf
from ._progress import Progress, hearing
from ._words import Asking, kept, path_of_urdf, setup_with, text_of_session, text_of_urdf, whole, written
from .answers import CalibrationReport, Channel, Description, Estimate, Model, Observed, Status, Suggestion, Suggestions, ToldObservation


def shapes_of_urdf(path: str | PathLike[str]) -> str | None:
    """The shapes of the links whose meshes are beside a URDF, as ``init`` writes them; ``None`` if no mesh is."""
    setup = json.loads(setup_of_urdf(text_of_urdf(path), path=path_of_urdf(path)))
    shapes = setup["calibration"]["robot"].get("shapes")
    return None if shapes is None else str(shapes)


class Session(Asking):
    """A session with a robot: it is asked where to move, and told what was seen.

    A session is a list of events. ``save`` writes it, and ``load`` gives it again, to the last bit on the same build and kind of
    CPU. While it computes, other threads run.
    """

    def __init__(self, engine: Engine) -> None:
        """Use ``from_urdf``, ``from_config`` or ``load``."""
        self._engine = engine

    @classmethod
    def from_urdf(
        cls,
        urdf: str | PathLike[str],
        base: str | None = None,
        tip: str | None = None,
        *,
        agent: str | None = None,
        seed: int = 0,
        **calibration: Any,
    ) -> Session:
        """A session with the robot of a URDF, given as text or by the path of its file.

        ``base`` and ``tip`` are links, the ends of the chain; where one link hangs on nothing, and nothing on one link, they may
        be left out. Without more keys the position of a marker somewhere on ``tip`` is measured, and the robot stands
        somewhere: both are found. Meshes beside the file (STL, OBJ) say how thick its links are: no posture is suggested in which they
        meet. ``calibration`` are the keys of a calibration file, as ``sensor``, ``target``, ``base_``,
        ``prior`` and ``constraints``; ``base_`` is its table ``[base]``, where the robot stands.

        ``agent`` names who decides: ``global`` unless told otherwise, or an estimator and a policy as ``smoother:random``.
        """
        if "base_" in calibration:
            calibration["base"] = calibration.pop("base_")
        setup = json.loads(setup_of_urdf(text_of_urdf(urdf), base, tip, path_of_urdf(urdf)))
        return cls(Engine.open(written("calibration", setup_with(setup, agent, seed, **calibration))))

    @classmethod
    def from_config(
        cls, config: Mapping[str, Any] | str | PathLike[str], *, agent: str | None = None, seed: int = 0
    ) -> Session:
        """A session of a calibration file, by its path, or of its keys.

        A file names its URDF, which lies beside it; its ``[measurements]`` are left out. Among keys ``robot.urdf`` is the text
        of the URDF.
        """
        if isinstance(config, Mapping):
            setup: dict[str, Any] = {"calibration": dict(config)}
        else:
            setup = json.loads(setup_of_file(fspath(config)))
        return cls(Engine.open(written("calibration", setup_with(setup, agent, seed))))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Session:
        """A session that ``save`` wrote. Nothing is chosen again."""
        return cls(Engine.load(text_of_session(path)))

    def save(self, path: str | PathLike[str] | None = None) -> str:
        """The whole session as JSON, setup and events; written to ``path`` if there is one."""
        return kept(self._engine.save(), path)

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        """Sessions are copied and pickled as ``save`` writes them."""
        return _again, (self._engine.save(),)

    def _suggest(self, ask: dict[str, Any]) -> Suggestions:
        answer: Suggestions = json.loads(self._engine.suggest(written("suggest", ask), time.time()))
        return answer

    def _observe(self, observation: dict[str, Any]) -> Observed:
        answer: Observed = json.loads(self._engine.observe(written("observation", observation), time.time()))
        return answer

    def _outcome(self, id: int, outcome: dict[str, Any]) -> Suggestion:
        answer: Suggestion = json.loads(self._engine.outcome(id, written("outcome", outcome), time.time()))
        return answer

    def _joints(self) -> list[str]:
        return [joint["name"] for joint in self.description()["joints"]]

    def _mark(self, observation: int, excluded: bool) -> None:
        mark = self._engine.exclude if excluded else self._engine.include
        mark(observation, time.time())

    def suggestions(self) -> list[Suggestion]:
        """All suggestions that were ever made, whoever asked, each with its ``state``."""
        answer: list[Suggestion] = json.loads(self._engine.suggestions())
        return answer

    def observations(self) -> list[ToldObservation]:
        """All observations by ``number``: as they were ``told``, what was ``answer``-ed, and whether they are ``excluded``."""
        answer: list[ToldObservation] = json.loads(self._engine.observations())
        return answer

    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, in order."""
        answer: list[dict[str, Any]] = json.loads(self._engine.events())
        return answer

    def channels(self) -> list[Channel]:
        """The names of the channels, and the shapes of their readings."""
        answer: list[Channel] = json.loads(self._engine.channels())
        return answer

    def description(self) -> Description:
        """What stays the same: joints with kinds and limits (rad, m), channels, targets, parameters."""
        answer: Description = json.loads(self._engine.description())
        return answer

    def status(self) -> Status:
        """How it stands: ``observations``, ``outliers``, ``expected_error_mm``, ``wanted_mm``, ``enough``, ``failure``, …"""
        answer: Status = json.loads(self._engine.status())
        return answer

    def estimate(self) -> Estimate:
        """The robot as it is believed now: every joint's axis at zero with its covariance, the marker; m and rad."""
        answer: Estimate = json.loads(self._engine.estimate())
        return answer

    def model(self) -> Model:
        """The robot as it is believed now: ``joints``, ``marker``, ``others``, and the ``covariance`` of all that is learned."""
        answer: Model = json.loads(self._engine.model())
        return answer

    def _predict(self, rows: list[list[float]]) -> list[list[float]]:
        return [list(point) for point in self._engine.predict(rows)]

    def _readings(self, rows: list[list[float]]) -> list[dict[str, Any]]:
        answer: list[dict[str, Any]] = json.loads(self._engine.readings(rows))
        return answer

    def report(self, *, folds: int | None = 0, progress: Progress = None) -> CalibrationReport:
        """What ``body-schema calibrate`` says of the observations: the content of ``report.json``; see ``Asking``."""
        folds = None if folds is None else whole("folds", folds)
        with hearing(progress) as hear:
            answer: CalibrationReport = json.loads(self._engine.report(folds, hear))
        return answer

    def to_urdf(self, path: str | PathLike[str] | None = None) -> str:
        """The URDF with the learned origins, byte for byte the given one otherwise; written to ``path`` if there is one."""
        return kept(self._engine.described("calibrated.urdf"), path)

    def to_yaml(self, path: str | PathLike[str] | None = None) -> str:
        """The same origins by joint as ``kinematics.yaml``: x, y, z in m, roll, pitch, yaw in rad."""
        return kept(self._engine.described("kinematics.yaml"), path)

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """The observations that count, as the table that ``body-schema calibrate`` reads; rad and m."""
        return kept(self._engine.csv(), path)

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """The calibration file that goes with ``observations.csv`` and ``robot.urdf``."""
        return kept(self._engine.toml(), path)


def _again(text: str) -> Session:
    """A session from what ``save`` wrote."""
    return Session(Engine.load(text))
