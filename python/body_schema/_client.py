"""Sessions on a server, in the words of sessions here. Nothing but the standard library."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any

from ._engine import Engine, setup_of_file, setup_of_urdf
from ._errors import ConflictError, EngineError, Error, FieldError, NotFoundError, ServerError
from ._progress import Progress
from ._words import Asking, kept, path_of_urdf, setup_with, text_of_session, text_of_urdf, whole, written
from .answers import CalibrationReport, Channel, Description, Estimate, Model, Observed, Status, Suggestion, Suggestions, ToldObservation

TRIES = 3
"""How often a request is sent where no answer comes."""
WAIT_S = 0.3
"""How long is waited before the next time, longer each time, seconds."""


class Client:
    """A server of body-schema, by its address, as ``http://localhost:8080``.

    ``token`` is what the server asks for unless it is on this machine. ``timeout_s`` is how long an answer may take, seconds.
    """

    def __init__(self, url: str, *, token: str | None = None, timeout_s: float = 120.0) -> None:
        self.url = url.rstrip("/")
        self._token = token
        self._timeout_s = timeout_s

    def from_urdf(
        self,
        urdf: str | PathLike[str],
        base: str | None = None,
        tip: str | None = None,
        *,
        agent: str | None = None,
        seed: int = 0,
        **calibration: Any,
    ) -> RemoteSession:
        """Open a session with the robot of a URDF; see ``Session.from_urdf``."""
        if "base_" in calibration:
            calibration["base"] = calibration.pop("base_")
        setup = json.loads(setup_of_urdf(text_of_urdf(urdf), base, tip, path_of_urdf(urdf)))
        return self._open(setup_with(setup, agent, seed, **calibration))

    def from_config(
        self, config: Mapping[str, Any] | str | PathLike[str], *, agent: str | None = None, seed: int = 0
    ) -> RemoteSession:
        """Open a session of a calibration file, by its path, or of its keys; see ``Session.from_config``."""
        if isinstance(config, Mapping):
            setup: dict[str, Any] = {"calibration": dict(config)}
        else:
            setup = json.loads(setup_of_file(fspath(config)))
        return self._open(setup_with(setup, agent, seed))

    def load(self, path: str | PathLike[str]) -> RemoteSession:
        """A session of its own that goes on where ``save`` left one, here or on a server. Nothing is chosen again."""
        try:
            saved = json.loads(text_of_session(path))
            setup = {**saved["setup"], "version": saved["version"], "events": saved["events"]}
        except (ValueError, KeyError, TypeError) as error:
            raise EngineError(f"this is no session of body-schema: {fspath(path)}: {error!r}") from None
        try:
            return self._open(setup)
        except FieldError as error:
            # What nobody has written by hand has no field to mend.
            if error.field.split("[")[0].split(".")[0] in ("events", "version"):
                raise EngineError(str(error)) from None
            raise

    def session(self, id: str) -> RemoteSession:
        """A session that is there already, by its id."""
        return RemoteSession(self, id, self.request("GET", f"/v1/sessions/{urllib.parse.quote(id, safe='')}"))

    def _open(self, setup: dict[str, Any]) -> RemoteSession:
        try:
            opened = self.request("POST", "/v1/sessions", written("calibration", {"world": "outside", **setup}))
        except FieldError as error:
            # A key is called as it is in the calibration, as it is where the session is computed here.
            error.field = error.field.removeprefix("calibration.")
            raise
        return RemoteSession(self, opened["id"], opened)

    def request(self, method: str, path: str, body: object = None, key: str | None = None) -> Any:
        """The JSON of an answer; ``None`` where there is none. ``key`` is the ``Idempotency-Key``."""
        text = self.text(method, path, body, key)
        return json.loads(text) if text else None

    def text(self, method: str, path: str, body: object = None, key: str | None = None) -> str:
        """The text of an answer. What can be sent twice without harm is sent again where no answer comes."""
        headers = {"Accept": "*/*"}
        data = None
        if body is not None:
            headers["Content-Type"] = "application/json"
            data = (body if isinstance(body, str) else written("body", body)).encode()
        if key is not None:
            headers["Idempotency-Key"] = key
        if self._token is not None:
            headers["Authorization"] = f"Bearer {self._token}"
        request = urllib.request.Request(self.url + path, data=data, headers=headers, method=method)
        tries = TRIES if method != "POST" or key is not None else 1
        for again in range(tries):
            try:
                with urllib.request.urlopen(request, timeout=self._timeout_s) as answer:
                    return str(answer.read().decode())
            except urllib.error.HTTPError as error:
                with error:
                    raise _refused(error.code, error.read().decode(errors="replace")) from None
            except (urllib.error.URLError, OSError) as error:
                if again + 1 == tries:
                    reason = getattr(error, "reason", error)
                    raise ServerError(f"{self.url} does not answer: {reason}") from None
            time.sleep(WAIT_S * 2**again)
        raise ServerError(f"{self.url} does not answer")


class RemoteSession(Asking):
    """A session on a server, with the methods of ``Session``. It lives there until it is deleted."""

    def __init__(self, client: Client, id: str, resource: dict[str, Any]) -> None:
        self.id = id
        """By this ``Client.session`` finds it again."""
        self._client = client
        self._names = [joint["name"] for joint in resource["description"]["joints"]]
        self._path = f"/v1/sessions/{urllib.parse.quote(id, safe='')}"

    def _suggest(self, ask: dict[str, Any]) -> Suggestions:
        answer: Suggestions = self._client.request("POST", f"{self._path}/suggestions", written("suggest", ask))
        return answer

    def _observe(self, observation: dict[str, Any]) -> Observed:
        key, body = str(uuid.uuid4()), written("observation", observation)
        answer: Observed = self._client.request("POST", f"{self._path}/observations", body, key)
        return answer

    def _outcome(self, id: int, outcome: dict[str, Any]) -> Suggestion:
        answer: Suggestion = self._client.request("POST", f"{self._path}/suggestions/{id}/outcome", written("outcome", outcome))
        return answer

    def _joints(self) -> list[str]:
        return list(self._names)

    def suggestions(self) -> list[Suggestion]:
        """All suggestions that were ever made, whoever asked, each with its ``state``."""
        answer: list[Suggestion] = self._client.request("GET", f"{self._path}/suggestions")["suggestions"]
        return answer

    def observations(self) -> list[ToldObservation]:
        """All observations by ``number``: as they were ``told``, what was ``answer``-ed, and whether they are ``excluded``."""
        answer: list[ToldObservation] = self._client.request("GET", f"{self._path}/observations")["observations"]
        return answer

    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, in order."""
        answer: list[dict[str, Any]] = json.loads(self.save())["events"]
        return answer

    def channels(self) -> list[Channel]:
        """The names of the channels, and the shapes of their readings."""
        answer: list[Channel] = self._resource()["channels"]
        return answer

    def description(self) -> Description:
        """What stays the same: joints with kinds and limits (rad, m), channels, targets, parameters."""
        answer: Description = self._resource()["description"]
        return answer

    def status(self) -> Status:
        """How it stands: ``observations``, ``outliers``, ``expected_error_mm``, ``wanted_mm``, ``enough``, ``failure``, …"""
        answer: Status = self._resource()["status"]
        return answer

    def model(self) -> Model:
        """The robot as it is believed now: ``joints``, ``marker``, ``others``, and the ``covariance`` of all that is learned."""
        answer: Model = self._client.request("GET", f"{self._path}/result.json")["learners"][0]["model"]
        return answer

    def _resource(self) -> Any:
        return self._client.request("GET", self._path)

    def estimate(self) -> Estimate:
        """The robot as it is believed now: every joint's axis at zero with its covariance, the marker; m and rad.

        It is computed here, from the events of the session.
        """
        answer: Estimate = json.loads(self._here().estimate())
        return answer

    def _here(self) -> Engine:
        """The same session, computed here."""
        return Engine.load(self.save())

    def _predict(self, rows: list[list[float]]) -> list[list[float]]:
        return [list(point) for point in self._here().predict(rows)]

    def _readings(self, rows: list[list[float]]) -> list[dict[str, Any]]:
        answer: list[dict[str, Any]] = json.loads(self._here().readings(rows))
        return answer

    def _mark(self, observation: int, excluded: bool) -> None:
        path = f"{self._path}/observations/{observation}"
        self._client.text(*("DELETE", path) if excluded else ("PUT", f"{path}/included"))

    def report(self, *, folds: int | None = 0, progress: Progress = None) -> CalibrationReport:
        """What ``body-schema calibrate`` says of the observations: the content of ``report.json``. A server does not tell its progress."""
        query = "" if folds is None else f"?folds={whole('folds', folds)}"
        answer: CalibrationReport = self._client.request("GET", f"{self._path}/report.json{query}")
        return answer

    def to_urdf(self, path: str | PathLike[str] | None = None) -> str:
        """The URDF with the learned origins, byte for byte the given one otherwise; written to ``path`` if there is one."""
        return kept(self._client.text("GET", f"{self._path}/model.urdf"), path)

    def to_yaml(self, path: str | PathLike[str] | None = None) -> str:
        """The same origins by joint as ``kinematics.yaml``: x, y, z in m, roll, pitch, yaw in rad."""
        return kept(self._client.text("GET", f"{self._path}/kinematics.yaml"), path)

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """The observations that count, as the table that ``body-schema calibrate`` reads; rad and m."""
        return kept(self._client.text("GET", f"{self._path}/observations.csv"), path)

    def to_toml(self, path: str | PathLike[str] | None = None) -> str:
        """The calibration file that goes with ``observations.csv`` and ``robot.urdf``."""
        return kept(self._client.text("GET", f"{self._path}/calibration.toml"), path)

    def save(self, path: str | PathLike[str] | None = None) -> str:
        """The whole session as JSON, setup and events, for ``Session.load`` and ``Client.load``; written to ``path`` if there is
        one."""
        return kept(self._client.text("GET", f"{self._path}/session.json"), path)

    def delete(self) -> None:
        """Delete the session on the server, with all its events."""
        self._client.text("DELETE", self._path)


def _refused(status: int, text: str) -> Error:
    """The exception of an answer by RFC 9457, ``application/problem+json``."""
    try:
        problem = json.loads(text)
    except ValueError:
        problem = {}
    if not isinstance(problem, dict):
        problem = {}
    detail = str(problem.get("detail") or problem.get("title") or text or f"HTTP {status}")
    kind = _KINDS.get(str(problem.get("type") or "").rpartition(":")[2])
    if kind is not None:
        return kind(detail)
    if status in (400, 413, 422) and problem.get("field"):
        field, what, hint = (str(problem.get(key) or "") for key in ("field", "what", "hint"))
        return FieldError(detail, field, what or detail, hint)
    if status == 404:
        return NotFoundError(detail)
    if status == 409:
        return ConflictError(detail)
    if status == 422:
        return EngineError(detail)
    return ServerError(detail, status)


_KINDS: dict[str, type[Error]] = {
    "unknown-suggestion": NotFoundError,
    "unknown-observation": NotFoundError,
    "not-pending": ConflictError,
    "session-full": EngineError,
    "nothing-to-suggest": EngineError,
    "nothing-to-show": EngineError,
    "diverged": EngineError,
}
"""Problems that a session here has too, by their type, as the exceptions that it raises."""
