#!/usr/bin/env python3
"""A robot that calibrates itself through a server, with nothing but Python's standard library.

    body-schema serve                      # in another terminal
    python examples/http_client.py         # --url http://localhost:8080 --out calibrated.urdf

The robot is made up: an arm of three joints whose links are some millimetres longer or shorter than its URDF says, and a camera
system that sees a marker on its hand with noise of half a millimetre. Replace `Robot` by yours; the rest stays. While it runs, the
address that it prints shows it in the browser.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import sys
import time
import urllib.error
import urllib.request
import uuid

URDF = """<robot name="three">
  <link name="base"/> <link name="turret"/> <link name="upper"/> <link name="lower"/>
  <joint name="pan" type="revolute">
    <origin xyz="0 0 0.1"/> <parent link="base"/> <child link="turret"/> <axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.2"/> <parent link="turret"/> <child link="upper"/> <axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <origin xyz="0.4 0 0"/> <parent link="upper"/> <child link="lower"/> <axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
</robot>"""


class Robot:
    """The robot as it truly is."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)

    def move_and_look(self, target: dict[str, float]) -> tuple[dict[str, float], list[float] | None]:
        """Moves there; where the joints are then, rad, and where the marker is, m, or None where it is not seen."""
        # Joints stop a little beside where they were sent: what counts is where they are.
        joints = {name: position + self._draw.gauss(0.0, 0.002) for name, position in target.items()}
        pan, shoulder, elbow = joints["pan"], joints["shoulder"], joints["elbow"] + 0.02
        reach = 0.397 * math.cos(shoulder) + 0.26 * math.cos(shoulder + elbow)
        height = 0.304 - 0.397 * math.sin(shoulder) - 0.26 * math.sin(shoulder + elbow)
        place = (reach * math.cos(pan), reach * math.sin(pan), height)
        if place[0] < -0.1:
            return joints, None  # Behind the robot nobody looks.
        return joints, [x + self._draw.gauss(0.0, 0.0005) for x in place]


class Server:
    """Requests and answers in JSON."""

    def __init__(self, url: str, token: str | None) -> None:
        self.url, self._token = url.rstrip("/"), token

    def ask(self, method: str, path: str, body: object = None, key: str | None = None) -> str:
        """The text of an answer. Whatever may be sent twice is sent again where no answer comes."""
        headers = {"Content-Type": "application/json"} if body is not None else {}
        if key is not None:
            headers["Idempotency-Key"] = key
        if self._token is not None:
            headers["Authorization"] = f"Bearer {self._token}"
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, headers, method=method)
        for wait_s in (0.5, 1.0, 2.0, None):
            try:
                with urllib.request.urlopen(request, timeout=120) as answer:
                    return answer.read().decode()
            except urllib.error.HTTPError as error:
                # RFC 9457: what is wrong, where, and how to mend it.
                problem = json.loads(error.read() or b"{}")
                sys.exit(f"{method} {path}: {problem.get('detail', error)}")
            except (urllib.error.URLError, OSError) as error:
                if wait_s is None or (method == "POST" and key is None):
                    sys.exit(f"{self.url} does not answer: {getattr(error, 'reason', error)}")
                time.sleep(wait_s)
        raise AssertionError("the last try returns or ends")

    def json(self, *request: object) -> dict:
        return json.loads(self.ask(*request))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--url", default="http://localhost:8080", help="of the server (default: %(default)s)")
    parser.add_argument("--token", help="the server's token, where it asks for one")
    parser.add_argument("--out", metavar="FILE", help="write the calibrated URDF there")
    parser.add_argument("--movements", type=int, default=40, metavar="N", help="at most so many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the robot's noise (default: %(default)s)")
    arguments = parser.parse_args()

    server, robot = Server(arguments.url, arguments.token), Robot(arguments.seed)
    calibration = {
        "name": "three-joints",
        "robot": {"urdf": URDF, "base": "base", "tip": "lower"},
        "sensor": {"channel": "position", "sigma_m": 0.0005},
    }
    session = server.json("POST", "/v1/sessions", {"world": "outside", "calibration": calibration})["id"]
    path = f"/v1/sessions/{session}"
    print(f"watch it at {server.url}/?session={session}")

    for movement in range(1, arguments.movements + 1):
        asked = server.json("POST", f"{path}/suggestions", {})
        if "enough" in asked:
            enough = asked["enough"]
            print(f"enough: {enough['expected_error_mm']:.2f} mm expected, {enough['wanted_mm']:.2f} mm wanted")
            break
        suggestion = asked["suggestions"][0]
        executed, seen = robot.move_and_look(suggestion["configuration"])
        observation = {
            "suggestion_id": suggestion["id"],
            "configuration": executed,
            "measurements": {"marker": seen},
        }
        # With a key of its own it counts once, however often it is sent.
        answer = server.json("POST", f"{path}/observations", observation, str(uuid.uuid4()))
        if answer["seen"]:
            told = f"{answer['innovation_sigmas']:6.2f} sigma from what was expected"
        else:
            told = "nothing was seen".rjust(36)
        print(f"{movement:3}  {told}, an error of {answer['expected_error_mm']:6.2f} mm is expected now")

    urdf = server.ask("GET", f"{path}/model.urdf")
    if arguments.out is not None:
        with open(arguments.out, "w", encoding="utf-8") as file:
            file.write(urdf)
        print(f"calibrated description: {arguments.out}")
    print(f"report: {server.url}{path}/report.html")


if __name__ == "__main__":
    main()
