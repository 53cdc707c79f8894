"""What only a session on a server can do: be there already, be deleted, be answered too late, ask for a token."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import body_schema
from conftest import Program
from robot import Robot, calibration, urdf


class Deaf:
    """Passes requests on to a server; of the first ``broken`` that tell an observation it does not pass on the answer."""

    def __init__(self, url: str) -> None:
        self._behind = urlsplit(url)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self.broken = 0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                asking, _ = self._listening.accept()
            except OSError:
                return
            with asking, socket.create_connection((self._behind.hostname, self._behind.port)) as behind:
                asked = b""
                while not _is_whole(asked):
                    asked += asking.recv(65536)
                # One request to a connection, so that the answer ends with it.
                behind.sendall(asked.replace(b"\r\n", b"\r\nConnection: close\r\n", 1))
                answer = b""
                while part := behind.recv(65536):
                    answer += part
                if b"/observations " in asked and self.broken:
                    # It has happened, and nobody hears of it.
                    self.broken -= 1
                    continue
                asking.sendall(answer)

    def end(self) -> None:
        self._listening.close()


def _is_whole(asked: bytes) -> bool:
    head, gap, body = asked.partition(b"\r\n\r\n")
    lengths = [line.split(b":")[1] for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
    return bool(gap) and len(body) >= int(lengths[0] if lengths else 0)


@pytest.fixture
def deaf(program: Program) -> Iterator[Deaf]:
    deaf = Deaf(program.url)
    yield deaf
    deaf.end()


def test_what_was_not_heard_is_sent_again_and_counts_once(deaf: Deaf) -> None:
    session, robot = body_schema.Client(deaf.url).from_urdf(urdf(), "base", "tip", **calibration()), Robot(5)
    deaf.broken = 1
    target = session.suggest()["suggestions"][0]["configuration"]
    assert session.observe(target, marker=robot.sees(target))["observation"] == 1
    assert deaf.broken == 0 and len(session.observations()) == 1


def test_a_session_is_found_again_until_it_is_deleted(client: body_schema.Client) -> None:
    session, robot = client.from_urdf(urdf(), "base", "tip", **calibration()), Robot(6)
    target = session.suggest()["suggestions"][0]["configuration"]
    session.observe(target, marker=robot.sees(target))
    again = client.session(session.id)
    assert again.observations() == session.observations() and again.joints == session.joints
    again.delete()
    for call in [lambda: client.session(session.id), session.status, lambda: session.suggest(), session.delete]:
        with pytest.raises(body_schema.NotFoundError):
            call()


def test_who_does_not_carry_the_token_is_not_answered(binary: Path, tmp_path: Path) -> None:
    token = "correct-horse-battery-staple-correct-horse"
    (tmp_path / "token").write_text(token)
    program = Program(binary, "--token-file", str(tmp_path / "token"))
    try:
        with pytest.raises(body_schema.ServerError) as refused:
            body_schema.Client(program.url).session("one")
        assert refused.value.status == 401
        opened = body_schema.Client(program.url, token=token).from_urdf(urdf(), "base", "tip", **calibration())
        assert opened.status()["observations"] == 0
    finally:
        program.end()


def test_where_nobody_answers_it_is_said() -> None:
    with pytest.raises(body_schema.ServerError, match="does not answer") as refused:
        body_schema.Client("http://127.0.0.1:9").session("one")
    assert refused.value.status == 0
