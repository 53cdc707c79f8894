"""The one reader of URDFs, by which recordings and exports know a robot."""

from __future__ import annotations

import pytest

import body_schema
from body_schema._urdf import parse_urdf

URDF = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="f" type="fixed"><parent link="a"/><child link="b"/><axis xyz="0 0 0"/></joint>
<joint name="j" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 2"/>
<mimic joint="k" multiplier="-2" offset="0.5"/></joint></robot>"""


def test_what_does_not_move_needs_no_axis_and_what_mimics_says_what() -> None:
    tree = parse_urdf(URDF)
    assert (tree.name, list(tree.links), tree.joints["f"].moves) == ("r", ["a", "b", "c"], False)
    assert (tree.joints["j"].axis, tree.joints["j"].follows) == ((0.0, 0.0, 1.0), ("k", -2.0, 0.5))
    with pytest.raises(body_schema.FieldError, match="joint `j`: axis.*zero"):
        parse_urdf(URDF.replace("0 0 2", "0 0 0"))
