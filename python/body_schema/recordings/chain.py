"""The chain of a URDF as described: which joints a table needs, and about where the hand is."""

from __future__ import annotations

from collections.abc import Collection
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from .._errors import FieldError, wrong
from .._urdf import Joint, parse_urdf
from .._words import text_of_urdf

Array = NDArray[np.float64]


class Description:
    """The joints and links of a URDF, given as text or by the path of its file.

    Raises ``FieldError`` where it is no URDF of a tree.
    """

    def __init__(self, urdf: str | PathLike[str]) -> None:
        self.text = text_of_urdf(urdf)
        tree = parse_urdf(self.text.lstrip("\ufeff \t\r\n"), "urdf")
        self.name, self.links, self.joints, self._above = tree.name, tree.links, tree.joints, tree.above

    def base(self) -> str:
        """The link that hangs on nothing."""
        roots = [link for link in self.links if link not in self._above]
        if len(roots) != 1:
            raise wrong("base", f"{len(roots)} links hang on nothing: {', '.join(roots) or 'none'}", "name one with --base")
        return roots[0]

    def chain(self, base: str, tip: str) -> list[Joint]:
        """The joints from ``base`` to ``tip``, base first, fixed ones too."""
        for field, link in (("base", base), ("tip", tip)):
            if link not in self.links:
                raise wrong(field, f"the URDF has no link `{link}`", f"name one of {', '.join(self.links)}")
        chain: list[Joint] = []
        link = tip
        while link != base:
            joint = self._above.get(link)
            if joint is None or len(chain) > len(self.joints):
                raise wrong("tip", f"no chain of joints leads from `{base}` to `{tip}`", "name a tip that hangs on the base")
            chain.append(joint)
            link = joint.parent
        return chain[::-1]

    def tip(self, base: str, recorded: Collection[str]) -> str:
        """The end of the longest chain whose joints are all ``recorded``; it is asked for where two are equally long."""
        best: list[str] = []
        most = 0
        for link in self.links:
            try:
                reads = self.reads(self.chain(base, link))
            except FieldError:
                continue
            if not reads or not set(reads) <= set(recorded):
                continue
            if any(joint.parent == link and not joint.moves for joint in self.joints.values()):
                # A frame that is fixed on this link is further out.
                continue
            if len(reads) > most:
                best, most = [link], len(reads)
            elif len(reads) == most:
                best.append(link)
        if not best:
            raise _names(self.moving(), recorded)
        if len(best) > 1:
            raise wrong("tip", f"{len(best)} links are ends of equally long chains: {', '.join(best)}", "name one with --tip")
        return best[0]

    def moving(self) -> list[str]:
        """The joints that move and follow no other."""
        return [joint.name for joint in self.joints.values() if joint.moves and joint.follows is None]

    def reads(self, chain: list[Joint]) -> list[str]:
        """The joints whose columns a table of this chain has, base first: those that move; for one that mimics, the one it follows."""
        names = (joint.follows[0] if joint.follows else joint.name for joint in chain if joint.moves)
        return list(dict.fromkeys(names))

    def needs(self, chain: list[Joint], recorded: Collection[str]) -> list[str]:
        """``reads``, refused where one of them is not ``recorded``."""
        reads = self.reads(chain)
        if not reads:
            raise wrong("tip", "no joint between base and tip moves", "name other links with --base and --tip")
        if any(name not in recorded for name in reads):
            raise _names(reads, recorded)
        return reads

    def hand(self, chain: list[Joint], positions: Array) -> tuple[Array, Array]:
        """Where the tip is in the frame of the base, as described: rotations (N × 3 × 3) and places (N × 3, m).

        ``positions`` (N × n) are those of ``reads``, rad and m.
        """
        column = {name: positions[:, index] for index, name in enumerate(self.reads(chain))}
        turned = np.broadcast_to(np.eye(3), (len(positions), 3, 3)).copy()
        place = np.zeros((len(positions), 3))
        for joint in chain:
            place = place + turned @ np.array(joint.origin.at)
            turned = turned @ np.array(joint.origin.rotation)
            if not joint.moves:
                continue
            if joint.follows:
                name, multiplier, offset = joint.follows
                position = column[name] * multiplier + offset
            else:
                position = column[joint.name]
            if joint.kind == "prismatic":
                place = place + (turned @ np.array(joint.axis)) * position[:, None]
            else:
                turned = turned @ _turns(np.array(joint.axis), position)
        return turned, place


def _turns(axis: Array, angles: Array) -> Array:
    """Rotations about an axis, N × 3 × 3."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def _names(wanted: list[str], recorded: Collection[str]) -> FieldError:
    missing = [name for name in wanted if name not in recorded]
    other = [name for name in recorded if name not in wanted]
    what = f"{', '.join(missing)} of the URDF not in the recording, which has {', '.join(recorded) or 'no joints'}"
    example = f"--rename {other[0]}={missing[0]}" if other and missing else "--rename RECORDED=URDF"
    return wrong("joints", what, f"say which is which, as {example}, or name a shorter chain with --tip")
