"""One list of events, told step by step and loaded at once, here and on a server: prints how far the beliefs are apart.

    python same_belief.py URL URDF
"""

from __future__ import annotations

import json
import random
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import body_schema


def told(session: body_schema.Session | body_schema.RemoteSession) -> list[dict[str, Any]]:
    """Tells a session everything that can be told; what it suggested."""
    draw = random.Random(1007)
    suggested = []
    for movement in range(14):
        asked = session.suggest()["suggestions"][0]
        suggested.append(asked["configuration"])
        if movement == 3:
            session.reject(state="infeasible", reason="a table is in the way")
            continue
        if movement == 5:
            session.reject(state="abandoned")
            continue
        # Somewhere near: what counts is that both are told the same.
        executed = {name: position + draw.gauss(0.0, 1e-3) for name, position in asked["configuration"].items()}
        seen = [0.4 + draw.gauss(0.0, 0.1), draw.gauss(0.0, 0.1), 0.6 + draw.gauss(0.0, 0.1)]
        session.observe(executed, marker=None if movement == 7 else seen)
    # Nobody has suggested this one.
    anywhere = {name: 0.9 * position for name, position in suggested[0].items()}
    session.observe(anywhere, suggestion_id=None, marker=[0.5, 0.1, 0.5])
    session.exclude(2)
    session.exclude(4)
    session.include(2)
    return suggested


def numbers(value: object) -> Iterator[float]:
    """All numbers of a value, in order; texts count by their hash, so that another is far away."""
    if isinstance(value, dict):
        for key in sorted(value):
            yield from numbers(value[key])
    elif isinstance(value, list):
        for one in value:
            yield from numbers(one)
    elif isinstance(value, (int, float)):
        yield float(value)
    else:
        yield float(hash(value))


def apart(values: list[object]) -> float:
    """How far the numbers of any value are from those of the first, at most."""
    first, *others = (list(numbers(value)) for value in values)
    return max(abs(a - b) for other in others for a, b in zip(first, other, strict=True))


def main() -> None:
    url, urdf = sys.argv[1:]
    ends = {"base": "panda_link0", "tip": "panda_link8", "seed": 1007}
    client = body_schema.Client(url)
    here = body_schema.Session.from_urdf(urdf, **ends)
    there = client.from_urdf(urdf, **ends)
    suggested = [told(here), told(there)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.json"
        here.save(path)
        moved = client.load(path)
        there.save(path)
        fetched = body_schema.Session.load(path)
    all_four = [here, there, moved, fetched]
    found = {
        "numbers": len(list(numbers(here.model()))),
        "beliefs_apart": apart([session.model() for session in all_four]),
        "statuses_apart": apart([session.status() for session in all_four]),
        "suggestions_apart": max(apart(suggested), apart([session.suggest()["suggestions"][0] for session in all_four])),
        "status": here.status(),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
