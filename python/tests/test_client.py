"""The client, against a server of the same routes that keeps one session here."""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

import body_schema
from robot import Robot, calibration, urdf


class Server(ThreadingHTTPServer):
    session: body_schema.Session
    answers: dict[str, object]
    broken = 0

    def load(self, body: dict[str, object]) -> None:
        setup = {key: value for key, value in body.items() if key not in ("version", "events")}
        saved = {"version": body["version"], "setup": setup, "events": body["events"]}
        with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
            file.write(json.dumps(saved))
            file.flush()
            self.session = body_schema.Session.load(file.name)


class Handler(BaseHTTPRequestHandler):
    server: Server

    def answer(self, status: int, body: object) -> None:
        text = body if isinstance(body, str) else json.dumps(body)
        self.send_response(status)
        self.send_header("Content-Length", str(len(text.encode())))
        self.end_headers()
        self.wfile.write(text.encode())

    def handle_all(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        body = json.loads(self.rfile.read(length)) if length else {}
        route = [self.command, *self.path.strip("/").split("/")[1:]]
        try:
            self.answer(*self.route(route, body))
        except body_schema.FieldError as error:
            self.answer(422, {"detail": str(error), "field": error.field, "what": error.what, "mend": error.mend})
        except body_schema.NotFoundError as error:
            self.answer(404, {"detail": str(error)})
        except body_schema.ConflictError as error:
            self.answer(409, {"detail": str(error)})

    do_GET = do_POST = do_PUT = do_DELETE = handle_all

    def route(self, route: list[str], body: dict[str, object]) -> tuple[int, object]:
        server = self.server
        if self.headers.get("Authorization") != "Bearer secret":
            return 401, {"detail": "a token is required"}
        if route == ["POST", "sessions"]:
            assert body.pop("world") == "outside"
            if "events" in body:
                server.load(body)
            else:
                server.session = body_schema.Session.from_config(body["calibration"], seed=body["seed"])
        session = server.session
        match route:
            case ["POST", "sessions"] | ["GET", "sessions", "one"]:
                about = {"description": session.description(), "status": session.status(), "channels": session.channels()}
                return 201, {"id": "one", **about}
            case ["POST", "sessions", "one", "suggestions"]:
                return 200, session._suggest(body)
            case ["GET", "sessions", "one", "suggestions"]:
                return 200, {"suggestions": session.suggestions()}
            case ["GET", "sessions", "one", "observations"]:
                return 200, {"observations": session.observations()}
            case ["GET", "sessions", "one", "result.json"]:
                return 200, {"learners": [{"model": session.model()}]}
            case ["POST", "sessions", "one", "suggestions", id, "outcome"]:
                return 200, session._outcome(int(id), body)
            case ["POST", "sessions", "one", "observations"]:
                key = self.headers["Idempotency-Key"]
                if key not in server.answers:
                    server.answers[key] = session._observe(body)
                    if server.broken:
                        # It has happened, and nobody hears of it.
                        server.broken -= 1
                        self.close_connection = True
                        raise ConnectionAbortedError
                return 200, server.answers[key]
            case ["DELETE", "sessions", "one", "observations", number]:
                session.exclude(int(number))
                return 204, ""
            case ["PUT", "sessions", "one", "observations", number, "included"]:
                session.include(int(number))
                return 204, ""
            case ["GET", "sessions", "one", file]:
                made = {
                    "model.urdf": session.to_urdf,
                    "kinematics.yaml": session.to_yaml,
                    "observations.csv": session.to_csv,
                    "calibration.toml": session.to_toml,
                    "session.json": session.save,
                }
                return 200, session.report() if file == "report.json" else made[file]()
            case _:
                return 404, {"detail": f"there is no {self.path}"}

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server(("127.0.0.1", 0), Handler)
    server.answers = {}
    server.handle_error = lambda *_: None
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


def client(server: Server, token: str | None = "secret") -> body_schema.Client:
    return body_schema.Client(f"http://127.0.0.1:{server.server_port}/", token=token)


def test_a_session_there_is_as_one_here(server: Server) -> None:
    there = client(server).from_urdf(urdf(), "base", "tip", seed=5, **calibration())
    here = body_schema.Session.from_urdf(urdf(), "base", "tip", seed=5, **calibration())
    robots = Robot(4), Robot(4)
    for _ in range(5):
        answers = []
        for session, robot in zip((there, here), robots):
            target = session.suggest()["suggestions"][0]["configuration"]
            answers.append(session.observe(target, marker=robot.sees(target)))
        assert answers[0] == answers[1]
    for session in (there, here):
        session.exclude(2)
        session.include(2)
        session.suggest()
        session.reject(state="abandoned")
    assert client(server).session(there.id).suggestions() == here.suggestions()
    assert (there.to_urdf(), there.to_yaml(), there.to_csv()) == (here.to_urdf(), here.to_yaml(), here.to_csv())
    assert there.report() == here.report() and there.joints == here.joints


def test_what_is_known_of_a_session_here_is_known_of_one_there(server: Server) -> None:
    there, robot = client(server).from_urdf(urdf(), "base", "tip", **calibration()), Robot(6)
    for _ in range(3):
        target = there.suggest()["suggestions"][0]["configuration"]
        there.observe(target, marker=robot.sees(target))
    here = server.session
    assert there.status() == here.status() and there.channels() == here.channels()
    assert there.description() == here.description() and there.model() == here.model()
    assert there.observations() == here.observations() and there.events() == here.events()
    assert there.to_toml() == here.to_toml()


def test_a_saved_session_goes_on_wherever_it_is_loaded(server: Server, tmp_path: Path) -> None:
    here, robot = body_schema.Session.from_urdf(urdf(), "base", "tip", **calibration()), Robot(7)
    target = here.suggest()["suggestions"][0]["configuration"]
    here.observe(target, marker=robot.sees(target))
    here.save(tmp_path / "robot.json")
    there = client(server).load(tmp_path / "robot.json")
    assert there.save() == here.save() and there.suggest() == here.suggest()
    (tmp_path / "other.json").write_text('{"events": []}')
    with pytest.raises(body_schema.EngineError, match="no session of body-schema"):
        client(server).load(tmp_path / "other.json")


def test_what_was_not_heard_is_sent_again_and_counts_once(server: Server) -> None:
    session, robot = client(server).from_urdf(urdf(), "base", "tip", **calibration()), Robot(5)
    server.broken = 1
    target = session.suggest()["suggestions"][0]["configuration"]
    assert session.observe(target, marker=robot.sees(target))["observation"] == 1
    assert len(server.session.observations()) == 1


def test_refusals_are_the_same_exceptions(server: Server) -> None:
    session = client(server).from_urdf(urdf(), "base", "tip", **calibration())
    with pytest.raises(body_schema.FieldError) as refused:
        session.observe({"pan": 0.0}, marker=None)
    assert refused.value.field == "configuration.lift" and refused.value.mend
    with pytest.raises(body_schema.NotFoundError):
        session.reject(9)
    session.suggest()
    session.reject(1)
    with pytest.raises(body_schema.ConflictError):
        session.reject(1)
    with pytest.raises(body_schema.ServerError) as refused:
        client(server, token=None).session("one")
    assert refused.value.status == 401
    with pytest.raises(body_schema.ServerError, match="does not answer"):
        body_schema.Client("http://127.0.0.1:9").session("one")
