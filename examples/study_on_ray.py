#!/usr/bin/env python3
"""A study of thousands of runs, spread over a Ray cluster.

    pip install ray matplotlib
    python examples/study_on_ray.py arm-6dof --learner global --learner random --seeds 2000 --steps 60 --out study
    python examples/study_on_ray.py arm-6dof --seeds 200 --out study --local-nodes 2     # two nodes on this machine, to try it

Each task is `body-schema compare --shard I/N`, one part of the seeds on one core of some node; what it wrote comes back here, where
`body-schema merge` puts all parts together. Nodes need the program `body-schema` and nothing else (`--program` says where it is there).
Parts that are in the folder already are not computed again, so that a study that was cut short goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import ray


@ray.remote(num_cpus=1, max_retries=3)
def part(command: list[str], shard: str) -> tuple[bytes, str]:
    """The file of one part, and the node that computed it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part"
        made = subprocess.run([*command, "--threads", "1", "--shard", shard, "--part", str(path)], capture_output=True, text=True)
        if made.returncode != 0:
            raise RuntimeError(f"part {shard}: {made.stderr.strip()}")
        return path.read_bytes(), ray.get_runtime_context().get_node_id()


def compute(command: list[str], parts: int, folder: Path) -> list[Path]:
    """All parts, in files of the folder."""
    paths = {f"{index}/{parts}": folder / f"part-{index}-of-{parts}.ndjson.gz" for index in range(1, parts + 1)}
    waiting = {part.remote(command, shard): shard for shard, path in paths.items() if not path.exists()}
    began, nodes, count = time.monotonic(), set(), len(waiting)
    while waiting:
        (done,), _ = ray.wait(list(waiting), num_returns=1)
        path = paths[waiting.pop(done)]
        content, node = ray.get(done)
        nodes.add(node)
        # It has its name only once it is whole.
        unfinished = path.with_suffix(".unfinished")
        unfinished.write_bytes(content)
        os.replace(unfinished, path)
        print(f"\r{count - len(waiting)} of {count} parts, {time.monotonic() - began:.0f} s", end="", flush=True)
    if count > 0:
        print(f"\n{count} parts on {len(nodes)} nodes in {time.monotonic() - began:.0f} s")
    return list(paths.values())


def hold(path: Path, study: dict) -> None:
    """Keeps what the folder is about, and refuses to mix it with another study."""
    text = json.dumps(study, indent=2)
    if path.exists() and path.read_text(encoding="utf-8") != text:
        sys.exit(f"{path.parent} holds parts of another study ({path.name} says which); name another folder with --out")
    path.write_text(text, encoding="utf-8")


def draw(study: dict, path: Path) -> None:
    """How many runs have converged by when, and the error of predictions on the way."""
    figure, (reached, errors) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for learner in study["learners"]:
        runs = len(learner["runs"])
        at = sorted(run["converged_at"] for run in learner["runs"] if run["converged_at"] is not None)
        shares = [100 * count / runs for count in range(len(at) + 1)]
        (line,) = reached.step([0, *at, study["steps"]], [*shares, shares[-1]], where="post", label=learner["name"])
        curve = [(one["movements"], one["prediction_mean_m"]) for one in learner["curve"] if one["prediction_mean_m"]]
        movements = [movement for movement, _ in curve]
        low, middle, high = ([1e3 * error[key] for _, error in curve] for key in ("q25", "median", "q75"))
        errors.plot(movements, middle, color=line.get_color(), label=learner["name"])
        errors.fill_between(movements, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    runs = len(study["learners"][0]["runs"])
    reached.set(title=f"{study['scenario']}: {runs} runs each", xlabel="movements", ylabel="converged, % of the runs", ylim=(-2, 102))
    errors.set(title="median and quartiles over the runs", xlabel="movements", ylabel="prediction error, mm", yscale="log")
    for axes in (reached, errors):
        axes.set_xlim(0, study["steps"])
        axes.grid(alpha=0.3)
        axes.legend(loc="center right" if axes is reached else "upper right")
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", help="a built-in scenario, or the path of a file that all nodes have")
    parser.add_argument("--learner", action="append", default=[], metavar="NAME", help="repeat for several (default: the scenario's)")
    parser.add_argument("--seeds", default="2000", help="as compare takes them: 2000, or 101..300 (default: %(default)s)")
    parser.add_argument("--steps", type=int, metavar="N", help="movements of every run (default: the scenario's)")
    parser.add_argument("--parts", type=int, metavar="N", help="tasks (default: four for each core of the cluster)")
    parser.add_argument("--out", type=Path, default=Path("study"), metavar="DIR", help="where parts, JSON, CSV and figure go (default: %(default)s)")
    parser.add_argument("--program", default="body-schema", help="as the nodes call it (default: %(default)s)")
    parser.add_argument("--address", default="auto", help="of the cluster (default: %(default)s)")
    parser.add_argument("--local-nodes", type=int, metavar="N", help="begin a cluster of so many nodes on this machine, a core each")
    arguments = parser.parse_args()

    cluster = None
    if arguments.local_nodes:
        from ray.cluster_utils import Cluster

        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
        for _ in range(arguments.local_nodes - 1):
            cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
    ray.init(address=cluster.address if cluster else arguments.address, log_to_driver=False, logging_level="ERROR")
    try:
        command = [arguments.program, "compare", arguments.scenario, "--seeds", arguments.seeds]
        command += [word for name in arguments.learner for word in ("--learner", name)]
        command += ["--steps", str(arguments.steps)] if arguments.steps else []
        arguments.out.mkdir(parents=True, exist_ok=True)
        parts = arguments.parts or 4 * int(ray.cluster_resources()["CPU"])
        hold(arguments.out / "study-of.json", {"command": command[1:], "parts": parts})
        paths = compute(command, parts, arguments.out)
    except ray.exceptions.RayTaskError as error:
        sys.exit(str(error.cause))
    finally:
        ray.shutdown()
        if cluster:
            cluster.shutdown()

    names = {name: arguments.out / f"study.{name}" for name in ("json", "csv", "png")}
    outputs = ["--json", str(names["json"]), "--csv", str(names["csv"])]
    merged = subprocess.run([arguments.program, "merge", *map(str, paths), *outputs])
    if merged.returncode != 0:
        sys.exit(merged.returncode)
    draw(json.loads(names["json"].read_text(encoding="utf-8")), names["png"])
    print(f"wrote {names['json']}, {names['csv']} and {names['png']}")


if __name__ == "__main__":
    main()
