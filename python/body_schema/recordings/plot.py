"""What was taken of a recording, as a picture: joints, sensors and rows over time."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from .._tables import pyplot

if TYPE_CHECKING:
    from .taken import Taken

KEPT, LEFT_OUT = "#2f7d4f", "#b4472e"
MOST_S = 120.0
"""Of a longer recording the beginning is shown."""


def plot(taken: Taken, path: str | PathLike[str]) -> None:
    """Write it to ``path``, in the format of its ending. Needs matplotlib."""
    plt = pyplot()
    begin = float(taken.joints.times[0])
    end = min(float(taken.joints.times[-1]), begin + MOST_S)
    figure, (above, below) = plt.subplots(
        2, 1, sharex=True, figsize=(8.0, 4.6), layout="constrained", gridspec_kw={"height_ratios": [3, 2]}
    )
    here = (taken.joints.times >= begin) & (taken.joints.times <= end)
    above.plot(taken.joints.times[here] - begin, taken.joints.positions[here], linewidth=0.9)
    above.legend(taken.joints.names, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    whole = "" if end >= float(taken.joints.times[-1]) else f"; its first {MOST_S:g} s"
    title = f"{taken.recording.path.name}: {len(taken.kept)} of {len(taken.rows)} rows are taken{whole}"
    above.set(ylabel="joints, rad or m", title=title)
    for sensor in taken.sensors:
        seconds, _ = taken.used[sensor.name]
        times, values = sensor.times + seconds - begin, _scaled(sensor.completed()[:, :3])
        shown = times <= end - begin
        below.plot(times[shown], values[shown], ".", markersize=2.0)
    below.set(xlabel="time by the clock of the joints, s", ylabel="readings, each\nfrom least to most", yticks=[])
    for row in taken.rows:
        if row.start > end:
            continue
        for axes in (above, below):
            colour = LEFT_OUT if row.dropped else KEPT
            # A moment of a robot that moves has no width.
            axes.axvspan(row.start - begin, max(row.end, row.start + 0.05) - begin, color=colour, alpha=0.18, linewidth=0)
    names = [(KEPT, "a row of the table"), (LEFT_OUT, "left out")]
    patches = [plt.Rectangle((0, 0), 1, 1, color=colour, alpha=0.3) for colour, _ in names]
    figure.legend(patches, [name for _, name in names], loc="outside lower center", ncols=2, frameon=False)
    above.set_xlim(0.0, end - begin)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _scaled(values: Any) -> Any:
    low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    return (values - low) / np.maximum(high - low, 1e-12)
