"""What schemathesis cannot know: ids of sessions that exist, and bodies that mean something to them.

Two in three valid requests are turned into such ones, and all that it made invalid stay as they are.
"""

import collections
import itertools
import json
import math
import os
import threading
import urllib.error
import urllib.parse
import urllib.request

import schemathesis
from schemathesis import GenerationMode

SERVER = os.environ["BODY_SCHEMA_SERVER"]
JOINTS = ("turn", "lift", "elbow")
ARM = "<robot name='stranger'><link name='base'/>" + "".join(
    f"<link name='link_{name}'/><joint name='{name}' type='revolute'><parent link='{parent}'/><child link='link_{name}'/>"
    f"<origin xyz='0.3 0 0.1'/><axis xyz='{axis}'/><limit lower='-1.5' upper='1.5' effort='1' velocity='1'/></joint>"
    for name, parent, axis in zip(JOINTS, ("base", "link_turn", "link_lift"), ("0 0 1", "0 1 0", "0 1 0"))
) + "</robot>"
ROBOT = {
    "world": "outside",
    "calibration": {
        "robot": {"urdf": ARM, "base": "base", "tip": "link_elbow"},
        "sensor": {"channel": "position", "sigma_m": 0.001},
        "selection": {"evaluations": 20, "ahead": 1},
    },
}
EXPERIMENT = {"scenario": "arm-6dof", "learners": ["random", "human"]}
#: Streams end with their session, which is deleted after so many seconds.
STREAMS, STREAM_S = ("followReports", "followRecording"), 0.2
#: What a description cannot say of valid bodies: by operation the fields that a 422 may name nevertheless.
UNSAID = {
    # A calibration is what `body-schema calibrate` reads: its keys depend on each other, and docs/calibrate.md has them.
    "openSession": ("calibration", "agent", "events", "scenario", "learners", "version", "set"),
    # Names and positions of the session's own joints and channels.
    "observe": ("configuration", "measurements", "suggestion_id"),
    "suggest": ("wanted",),
    "evaluateConfiguration": ("configuration",),
    "setConfiguration": ("configuration",),
    # As many as there are observations.
    "getReport": ("folds",),
    # At most 1000 postures in one request: the product of two numbers. Who waits for a person makes one step at a time.
    "makeSteps": ("frames", "count"),
}


def ask(method, path, body=None):
    """(status, answer) of a request beside the tested ones."""
    content = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(SERVER + path, content, {"Content-Type": "application/json"}, method=method)
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return response.status, response.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read()


def posture(number):
    return {joint: round(1.2 * math.sin(number + at), 3) for at, joint in enumerate(JOINTS)}


def observation(number):
    return {"configuration": posture(number), "measurements": {"marker": [0.6 + 0.001 * number, 0.2, 0.3]}}


class Sessions:
    """Sessions with something in them, opened when none is left."""

    #: One is used so often: those of robots grow with what is told, and so does the work of their reports.
    TURNS = 30

    def __init__(self):
        self.lock = threading.Lock()
        self.ids, self.turns = {}, {}

    def new(self, kind):
        status, answer = ask("POST", "/v1/sessions", ROBOT if kind == "robot" else EXPERIMENT)
        assert status == 201, answer
        session = json.loads(answer)["id"]
        if kind == "robot":
            for number in range(1, 4):
                ask("POST", f"/v1/sessions/{session}/observations", observation(number))
            ask("POST", f"/v1/sessions/{session}/suggestions", {"count": 2})
        else:
            ask("POST", f"/v1/sessions/{session}/learners/human/configuration", {"configuration": [0.1] * 6})
            ask("POST", f"/v1/sessions/{session}/steps")
        return session

    def any(self, kind):
        """One that is there: a `robot`, or an `experiment`."""
        with self.lock:
            session = self.ids.get(kind)
            self.turns[kind] = self.turns.get(kind, 0) + 1
            is_worn = self.turns[kind] % self.TURNS == 0
            if session is None or is_worn or ask("GET", f"/v1/sessions/{session}")[0] != 200:
                if is_worn:
                    ask("DELETE", f"/v1/sessions/{session}")
                session = self.ids[kind] = self.new(kind)
            return session


SESSIONS = Sessions()
#: Sessions that tested requests have opened, oldest first. So many are left for requests that go on with them; the server is not
#: to be full of those that nobody uses.
OPENED, LEFT = collections.deque(), 16
TURNS = itertools.count()
LOCK = threading.Lock()


@schemathesis.hook
def before_call(context, case, kwargs):
    operation = case.operation.definition.raw.get("operationId", "")
    mend(case, operation)
    if operation in STREAMS:
        session = str((case.path_parameters or {}).get("id"))
        path = f"/v1/sessions/{urllib.parse.quote(session, safe='')}"
        threading.Timer(STREAM_S, ask, ("DELETE", path)).start()


@schemathesis.hook
def after_call(context, case, response):
    if case.operation.definition.raw.get("operationId") != "openSession" or response.status_code != 201:
        return
    OPENED.append(json.loads(response.content)["id"])
    while len(OPENED) > LEFT:
        ask("DELETE", f"/v1/sessions/{OPENED.popleft()}")


def mend(case, operation):
    """Makes a valid request mean something, two times in three."""
    with LOCK:
        turn = next(TURNS)
    if case.meta is None or case.meta.generation.mode != GenerationMode.POSITIVE or turn % 3 == 2:
        return
    tags = case.operation.definition.raw.get("tags", [])
    kind = "robot" if "robots" in tags or "results" in tags and turn % 2 else "experiment"
    if case.path_parameters and "id" in case.path_parameters:
        case.path_parameters["id"] = SESSIONS.any(kind)
        for name, value in {"n": 1 + turn % 4, "sid": 1 + turn % 4, "name": ("human", "random")[turn % 2]}.items():
            if name in case.path_parameters:
                case.path_parameters[name] = value
    if operation == "openSession":
        case.body = ROBOT if turn % 2 else {**EXPERIMENT, "seed": turn}
    elif operation == "observe":
        case.body = observation(turn)
    elif operation == "suggest" and isinstance(case.body, dict) and case.body.get("wanted"):
        case.body["wanted"] = [posture(turn)]
    elif operation in ("evaluateConfiguration", "setConfiguration"):
        case.body = {"configuration": [round(math.sin(turn + at), 3) for at in range(6)]}


@schemathesis.hook
def filter_failure(context, failure, case, response):
    """Of valid requests that were refused, only those count whose fault the description could have told."""
    # A suggestion's number is counted by the session, and may be one that it has not made yet.
    if failure.code == "ST302":
        return json.loads(response.content).get("field", "") != "sid"
    if failure.code != "ST202":
        return True
    fields = UNSAID.get(case.operation.definition.raw.get("operationId", ""), ())
    problem = json.loads(response.content)
    told, is_parameter = problem.get("field", ""), "there is no parameter" in problem.get("detail", "")
    field = told.split(".")[0].split("[")[0]
    described = [parameter.name for parameter in case.operation.query]
    # Names of parameters are told as they came.
    given = urllib.parse.unquote_plus(told)
    is_misspelt = response.status_code == 400 and given not in described and is_parameter
    return not (is_misspelt or response.status_code == 422 and field in fields)
