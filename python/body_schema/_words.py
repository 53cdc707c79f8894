"""The words in which a robot is asked and told, the same for a session here and one on a server."""

from __future__ import annotations

import json
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal, Union

from ._errors import EngineError, Error, FieldError, wrong
from ._progress import Progress
from ._tables import axes, pandas, row_of, short_table
from .answers import CalibrationReport, Channel, Description, Estimate, Model, Observed, Status, Suggestion, Suggestions, ToldObservation

Configuration = Union[Mapping[str, float], Sequence[float]]
"""Joint positions by name; rad (revolute) or m (prismatic). A list of them needs the names of its joints beside it."""

PENDING: Literal["pending"] = "pending"


def written(field: str, value: object) -> str:
    """JSON, with arrays of numpy as lists."""

    def plain(other: Any) -> Any:
        if hasattr(other, "tolist"):
            return other.tolist()
        raise TypeError(f"{type(other).__name__} is neither number, text, list nor dict")

    try:
        return json.dumps(value, default=plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise wrong(field, str(error), "write finite numbers, texts, lists and dicts") from None


def size_doubt(name: str, scale: float, deviation: float, is_guess: bool) -> list[str]:
    """What is said of a target that seems ``scale`` ± ``deviation`` times as large as described; nothing where that may be chance. ``is_guess`` says that the
    camera's focal length is learned."""
    if not abs(scale - 1) > max(0.03, 5 * deviation):
        return []
    lens = "" if is_guess else "the focal length is wrong by as much, or "
    return [
        f"{name} seems {scale:.3f} ± {deviation:.3f} times as large as described, by the lengths of the URDF: measure its black square and the "
        f"print's ruler; or {lens}the URDF is"
    ]


def path_of_urdf(urdf: str | PathLike[str]) -> str | None:
    """The path of a URDF; ``None`` if it is given as text."""
    return None if isinstance(urdf, str) and urdf.lstrip("\ufeff \t\r\n").startswith("<") else fspath(urdf)


def text_of_urdf(urdf: str | PathLike[str]) -> str:
    """The text of a URDF that is given as such, or by the path of its file."""
    if path_of_urdf(urdf) is None:
        return str(urdf)
    try:
        return Path(urdf).read_text(encoding="utf-8")
    except OSError as error:
        raise wrong("urdf", f"{urdf}: {error.strerror}", "name a file that can be read, or pass its text") from None


def by_name(configuration: Configuration, joints: Sequence[str] | None, known: Sequence[str]) -> dict[str, float]:
    """Positions by name, of a list in the order of ``joints``.

    A list without ``joints`` is refused: values in another order, as in the alphabet, are positions as good as any.
    """
    if isinstance(configuration, Mapping):
        if joints is not None:
            raise wrong("joints", "the configuration names its joints already", "leave `joints` out")
        return dict(configuration)
    order = ", ".join(known)
    if joints is None:
        what = "a list does not say which joint each position is of"
        mend = f"tell a dict of positions by name, or name the order of the list: joints=[…], some order of {order}"
        raise wrong("configuration", what, mend)
    names, positions = list(joints), list(configuration)
    if isinstance(joints, str) or sorted(map(str, names)) != sorted(known):
        raise wrong("joints", f"{', '.join(map(str, names))} are not the joints", f"name each of {order}, once")
    if len(positions) != len(names):
        what = f"{len(positions)} positions are none of {len(names)} joints"
        raise wrong("configuration", what, f"tell all of {', '.join(names)}")
    return dict(zip(names, positions))


def _a_list(field: str, configurations: object) -> None:
    """Refuses a dict where a list of them is meant."""
    if isinstance(configurations, Mapping):
        raise wrong(field, "a dict is one configuration", "write a list of them: [{…}]")


def positions(configuration: Mapping[str, object], names: Sequence[str]) -> list[float]:
    """The positions of all joints in the order of ``names``; refused where one is missing, unknown or no finite number."""
    if missing := [name for name in names if name not in configuration]:
        raise wrong(f"configuration.{missing[0]}", "missing", "tell where every joint is")
    if unknown := [name for name in configuration if name not in names]:
        raise wrong(f"configuration.{unknown[0]}", "there is no such joint", f"name {', '.join(names)}")
    found = []
    for name in names:
        told = configuration[name]
        try:
            value = math.nan if isinstance(told, (str, bytes)) else float(told)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            raise wrong(f"configuration.{name}", f"{told!r} is no finite number", "write rad (revolute) or m (prismatic)")
        found.append(value)
    return found


def points_of(reading: object) -> object:
    """A reading of pixels as ``[[u, v], …]``: OpenCV's shapes 1 x N x 2 and N x 1 x 2 without their empty axis, ``None`` for a point whose
    numbers are NaN. Any other reading as it is.
    """

    def plain(it: object) -> object:
        it = it.tolist() if hasattr(it, "tolist") else it
        return [plain(part) for part in it] if isinstance(it, (list, tuple)) else it

    found = plain(reading)
    if not isinstance(found, list) or not found or any(not isinstance(it, list) for it in found if it is not None):
        return found
    if len(found) == 1 and found[0] and all(isinstance(it, list) and len(it) == 2 for it in found[0]):
        (found,) = found
    elif all(it is None or (len(it) == 1 and isinstance(it[0], list) and len(it[0]) == 2) for it in found):
        found = [it and it[0] for it in found]
    absent = [isinstance(it, list) and bool(it) and all(isinstance(x, float) and math.isnan(x) for x in it) for it in found]
    return [None if gone else it for gone, it in zip(absent, found)]


def whole(field: str, number: object) -> int:
    """A number by which something is counted."""
    try:
        counted = operator.index(number)  # type: ignore[arg-type]
    except TypeError:
        counted = -1
    if isinstance(number, bool) or not 0 <= counted < 2**63:
        raise wrong(field, f"{number!r} is no number of anything", "write a whole number, counted from 1")
    return counted


def text_of_session(path: str | PathLike[str]) -> str:
    """The text that ``save`` wrote."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise EngineError(f"this is no session of body-schema: {error}") from None


def setup_with(setup: dict[str, Any], agent: str | None, seed: int, **calibration: Any) -> dict[str, Any]:
    """A setup with more keys of its calibration."""
    for key, value in calibration.items():
        if key == "robot" and isinstance(value, Mapping):
            setup["calibration"]["robot"].update(value)
        else:
            setup["calibration"][key] = value
    if agent is not None:
        setup["agent"] = agent
    setup["seed"] = seed
    return setup


class Asking(ABC):
    """A session with a robot: it is asked where to move, and told what was seen."""

    # What differs between here and there.

    @abstractmethod
    def _suggest(self, ask: dict[str, Any]) -> Suggestions: ...

    @abstractmethod
    def _observe(self, observation: dict[str, Any]) -> Observed: ...

    @abstractmethod
    def _outcome(self, id: int, outcome: dict[str, Any]) -> Suggestion: ...

    @abstractmethod
    def _joints(self) -> list[str]: ...

    @abstractmethod
    def suggestions(self) -> list[Suggestion]:
        """All suggestions that were ever made, whoever asked, each with its ``state``."""

    @abstractmethod
    def observations(self) -> list[ToldObservation]:
        """All observations by ``number``: as they were ``told``, what was ``answer``-ed, and whether they are ``excluded``."""

    @abstractmethod
    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, in order."""

    @abstractmethod
    def channels(self) -> list[Channel]:
        """The names of the channels, and the shapes of their readings."""

    @abstractmethod
    def description(self) -> Description:
        """What stays the same: joints with kinds and limits (rad, m), channels, targets, parameters."""

    @abstractmethod
    def status(self) -> Status:
        """How it stands: ``observations``, ``outliers``, ``expected_error_mm``, ``wanted_mm``, ``enough``, ``failure``, …"""

    @abstractmethod
    def model(self) -> Model:
        """The robot as it is believed now: ``joints``, ``marker``, ``others``, and the ``covariance`` of all that is learned.

        At zero, in the frame of the measurements; m and rad. The covariance is that of tangent coordinates, row by row, of which
        every part lists its own as ``coordinates``; ``None`` for an estimator that keeps none.
        """

    @abstractmethod
    def estimate(self) -> Estimate:
        """The robot as it is believed now: every joint's axis at zero with its covariance, the marker; m and rad."""

    @abstractmethod
    def _predict(self, rows: list[list[float]]) -> list[list[float]]: ...

    @abstractmethod
    def _readings(self, rows: list[list[float]]) -> list[dict[str, Any]]: ...

    @abstractmethod
    def _mark(self, observation: int, excluded: bool) -> None: ...

    @abstractmethod
    def report(self, *, folds: int | None = 0, progress: Progress = None) -> CalibrationReport:
        """What ``body-schema calibrate`` says of the observations: the content of ``report.json``.

        All observations are learned from, and nothing is judged by rows that were not: ``held_out`` is ``None``. With ``folds``, as 5, every
        row is held out once, corrections beyond the axes are tried, and the curve of learning is drawn: it fits the robot anew for each,
        which may take a minute. ``None`` judges as the calibration file says, or in five folds.

        ``progress`` hears how far it is: a function of
        the stage's name, the steps done and all its steps; ``True`` shows a bar, ``False`` none, and without it there is one at a
        terminal and in a notebook. Ctrl-C ends it.
        """

    @abstractmethod
    def to_urdf(self, path: str | PathLike[str] | None = None) -> str:
        """The URDF with the learned origins, byte for byte the given one otherwise; written to ``path`` if there is one."""

    @abstractmethod
    def to_yaml(self, path: str | PathLike[str] | None = None) -> str:
        """The same origins by joint as ``kinematics.yaml``: x, y, z in m, roll, pitch, yaw in rad."""

    @abstractmethod
    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """The observations that count, as the table that ``body-schema calibrate`` reads; rad and m."""

    @abstractmethod
    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """The calibration file that goes with ``observations.csv`` and ``robot.urdf``."""

    @abstractmethod
    def save(self, path: str | PathLike[str] | None = None) -> str:
        """The whole session as JSON, setup and events; written to ``path`` if there is one."""

    # What is the same.

    @property
    def joints(self) -> list[str]:
        """The names of the joints that move, base first."""
        return self._joints()

    def predict(
        self, configurations: Sequence[Configuration], *, joints: Sequence[str] | None = None
    ) -> list[list[float]]:
        """Where the hand is believed to be at these configurations, ``[x, y, z]`` each, m, frame of the measurements.

        Each is told by name, or as a list whose order ``joints`` names.
        """
        return self._predict(self._rows(configurations, joints))

    def predict_readings(
        self, configurations: Sequence[Configuration], *, joints: Sequence[str] | None = None
    ) -> list[dict[str, Any]]:
        """What every channel would read at these configurations, as the robot is believed to be: by channel, as ``observe`` takes it.

        So there are positions, poses with their quaternions, pixels, distances and depths, each by the name of its channel; ``None``
        where nothing would be seen, and for a point that would not be. Sockets are not among them.
        """
        return self._readings(self._rows(configurations, joints))

    def _rows(self, configurations: Sequence[Configuration], joints: Sequence[str] | None) -> list[list[float]]:
        """The positions of all joints, base first."""
        names = self.joints
        _a_list("configurations", configurations)
        return [positions(by_name(it, None if isinstance(it, Mapping) else joints, names), names) for it in configurations]

    def suggest(
        self,
        count: int = 1,
        *,
        client: str | None = None,
        replan: bool = False,
        expires_s: float | None = None,
    ) -> Suggestions:
        """Where to move next.

        Gives ``{"suggestions": […], "enough": {…}}``: the client's pending suggestions, topped up to ``count`` and chosen
        together. Each has ``id``, ``configuration`` by joint name (rad, m), ``joints`` (their names, base first), ``expected_gain``, ``expected_error_mm_after``,
        ``chance_seen``, ``travel_rad`` and ``state``. Asking again gives the same until they are observed or rejected, unless
        ``replan`` replaces them. ``enough`` is there once the expected error of predictions (``expected_error_mm``) has been
        below what was wanted for five movements.

        ``client`` tells several askers of one session apart; ``expires_s`` is how long new suggestions stay pending, in
        seconds, for ever without it.
        """
        ask = {"count": count, "client": client, "replan": replan, "expires_s": expires_s}
        ask["count"] = whole("count", count)
        return self._suggest({key: value for key, value in ask.items() if value is not None})

    def enqueue(
        self,
        configurations: Iterable[Configuration],
        *,
        joints: Sequence[str] | None = None,
        client: str | None = None,
        expires_s: float | None = None,
    ) -> Suggestions:
        """Movements that somebody wants: ``suggest`` gives them next, in their order, before any that it chooses.

        Each becomes a pending suggestion of the ``client``, with its ``id`` and with what it is expected to teach, after those that are
        pending already (``suggest(replan=True)`` drops these). They are carried out, told and rejected as any other. A configuration is
        a dict by joint name, rad or m, or a list in the order of ``joints``. All are refused if one of them is beyond a limit or against
        the constraints; ``field`` names it, as ``wanted[2].elbow``. At most 20 suggestions of one client are pending.
        """
        known = self._joints()
        _a_list("configurations", configurations)
        wanted = [by_name(configuration, joints, known) for configuration in configurations]
        ask = {"wanted": wanted, "client": client, "expires_s": expires_s}
        if not wanted:
            raise wrong("configurations", "there are none", "name at least one configuration")
        return self._suggest({key: value for key, value in ask.items() if value is not None})

    def pending(self, client: str | None = None) -> list[Suggestion]:
        """The client's pending suggestions, the oldest first."""
        return [it for it in self.suggestions() if it["state"] == "pending" and it.get("client") == client]

    def observe(
        self,
        configuration: Configuration,
        /,
        *,
        joints: Sequence[str] | None = None,
        suggestion_id: int | Literal["pending"] | None = PENDING,
        client: str | None = None,
        measurements: Mapping[str, Any] | None = None,
        **channels: Any,
    ) -> Observed:
        """Tell where the robot moved, and what was seen there.

        ``configuration`` is where the joints *were*, by name, rad or m: what was executed, not what was suggested. A list of
        positions is taken where ``joints`` names its order. What was seen is told by channel, as keywords or in
        ``measurements``; ``None``, and a channel that is left out, saw nothing:

        ========  =======================  ===================================================================
        channel   its name                 shape
        ========  =======================  ===================================================================
        position  the target's             ``[x, y, z]``, m
        pose      the target's             ``{"position": [x, y, z], "quaternion": [x, y, z, w]}``, m
        pixels    ``CAMERA_TARGET``        ``[[u, v], …]``, px, one pair for each point, or as OpenCV's detectors give them;
                                           ``None`` or NaN for a point that is not seen, of a target that is ``partly_seen``
        distance  ``TARGET_distance``      m
        depth     ``CAMERA_TARGET_depth``  m
        sockets   ``socket``               ``"PLACE/NAME"``
        ========  =======================  ===================================================================

        It carries out the client's oldest pending suggestion, if there is one; ``suggestion_id`` names another, or ``None`` for
        a movement that nobody suggested.

        Gives ``observation`` (its number), ``seen``, ``innovation_sigmas`` (about 1 where all is well),
        ``outlier_probability``, ``expected_error_mm`` (of predictions, now) and ``body_seems_changed``.
        """
        if suggestion_id == PENDING:
            suggestion_id = next((it["id"] for it in self.pending(client)), None)
        told = by_name(configuration, joints, self.joints)
        for name, position in told.items():
            if isinstance(position, Real) and not math.isfinite(position):
                raise wrong(f"configuration.{name}", f"{position} is no finite number", "write rad (revolute) or m (prismatic)")
        seen = {name: points_of(it) for name, it in {**(measurements or {}), **channels}.items()}
        body: dict[str, Any] = {"configuration": told, "measurements": seen}
        if suggestion_id is not None:
            body["suggestion_id"] = whole("suggestion_id", suggestion_id)
        return self._observe(body)

    def add_many(self, observations: Iterable[Mapping[str, Any]]) -> list[Observed]:
        """Tell many observations that nobody suggested, as from a table or another session; what ``observe`` gives, for each.

        Each has ``configuration`` (by joint name, rad or m) and ``measurements`` (by channel), as ``told`` in ``observations()``; an
        id of a suggestion, which is another session's, is left out. They are told in order: where one is refused, ``FieldError`` names it, counted
        from 0, and those before it are in.
        """
        if hasattr(observations, "to_csv"):
            mend = 'tell a list: [{"configuration": {joint: row[joint] for joint in joints}, "measurements": {…}} for row in table.to_dict("records")]'
            raise wrong("observations", "a table does not say what its columns are", mend)
        answers = []
        for index, it in enumerate(observations):
            where = f"observations[{index}]"
            if not isinstance(it, Mapping) or "configuration" not in it:
                raise wrong(where, "it has no configuration", 'write {"configuration": {…}, "measurements": {…}}')
            try:
                answers.append(self.observe(it["configuration"], suggestion_id=None, measurements=it.get("measurements")))
            except FieldError as error:
                raise wrong(f"{where}.{error.field}", error.what or str(error), f"{error.mend}; {index} before it are in") from None
        return answers

    def observations_dataframe(self) -> Any:
        """All observations as a ``pandas.DataFrame``: a column for each joint (rad, m) and each part of a reading, titled as in ``to_csv``.

        Besides there are ``number``, ``excluded``, ``suggestion_id``, and what ``observe`` gave. Needs pandas.
        """
        joints, channels = self.joints, self.channels()
        return pandas().DataFrame([row_of(it, joints, channels) for it in self.observations()])

    def plot(self, ax: Any = None) -> Any:
        """The expected error of predictions after every observation, against what is wanted; mm. Gives the axes. Needs matplotlib."""
        ax = axes(ax)
        told = [it for it in self.observations() if not it["excluded"]]
        points = [(it["number"], it["answer"].get("expected_error_mm")) for it in told]
        known = [(number, error) for number, error in points if error is not None]
        ax.plot([number for number, _ in known], [error for _, error in known], marker="o", markersize=3, label="expected")
        ax.axhline(self.status()["wanted_mm"], color="0.4", linestyle="--", linewidth=1, label="wanted")
        if known:
            ax.set_yscale("log")
        ax.set(xlabel="observation", ylabel="error of predictions, mm")
        ax.legend(frameon=False)
        return ax

    def _repr_html_(self) -> str:
        """How it stands, as a notebook shows it."""
        try:
            status = self.status()
            rows: list[tuple[str, object]] = [("joints", ", ".join(self.joints)), ("observations", status["observations"])]
            if status.get("outliers"):
                rows.append(("outliers", status["outliers"]))
            if status.get("expected_error_mm") is not None:
                rows.append(("expected error", f"{status['expected_error_mm']:.2f} mm, wanted {status['wanted_mm']:.2f} mm"))
            rows.append(("enough", "yes" if status.get("enough") else "not yet"))
            if pending := [str(it["id"]) for it in self.suggestions() if it["state"] == "pending"]:
                rows.append(("pending suggestions", ", ".join(pending)))
            if status.get("failure"):
                rows.append(("failure", status["failure"]))
        except Error as error:
            rows = [("session", str(error))]
        return short_table(rows)

    def reject(
        self,
        suggestion_id: int | None = None,
        *,
        state: Literal["infeasible", "abandoned"] = "infeasible",
        reason: str | None = None,
        client: str | None = None,
    ) -> Suggestion:
        """Tell that a suggestion is not carried out; without ``suggestion_id`` the client's oldest pending one.

        ``infeasible``: the robot cannot go there, so that its neighbourhood is excluded, a wider one each time nearby.
        ``abandoned``: nobody goes there, which leaves no trace. Gives the suggestion with its new ``state``.
        """
        if suggestion_id is None:
            pending = self.pending(client)
            if not pending:
                raise wrong("suggestion_id", "nothing is pending", "ask for a suggestion first")
            suggestion_id = pending[0]["id"]
        outcome: dict[str, Any] = {"state": state}
        if reason is not None:
            outcome["reason"] = reason
        return self._outcome(whole("suggestion_id", suggestion_id), outcome)

    def exclude(self, observation: int) -> None:
        """Take an observation out, by its number: the belief becomes what the others give."""
        self._mark(whole("observation", observation), True)

    def include(self, observation: int) -> None:
        """Take an excluded observation in again: the belief becomes as if it had never been excluded."""
        self._mark(whole("observation", observation), False)


def kept(text: str, path: str | PathLike[str] | None) -> str:
    """The text, written to a file if one is named."""
    if path is not None:
        Path(path).write_bytes(text.encode("utf-8"))
    return text
