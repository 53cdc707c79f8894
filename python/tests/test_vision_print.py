"""What is printed is what is described: in true scale, the right way up, and readable."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

from vision_extra import need

need()

import numpy as np  # noqa: E402

import body_schema  # noqa: E402
from body_schema import FieldError  # noqa: E402
from body_schema.__main__ import main  # noqa: E402
from body_schema.vision import FAMILIES, Target, detect, page  # noqa: E402

CUBE = {"top": 0, "front": 1, "right": 2, "back": 3, "left": 4}
TARGETS = [
    Target.tag(3, 0.04),
    Target.tag(7, 0.025, family="aruco_4x4_50"),
    Target.charuco(7, 9, 0.025, 0.018),
    Target.charuco(9, 5, 0.028, 0.02),
    Target.cube(CUBE, 0.05, 0.036),
    Target.cube({**CUBE, "bottom": 5}, 0.045, 0.03),
]

Rects = list[tuple[float, float, float, float]]


def of_svg(data: bytes) -> tuple[tuple[float, float], Rects, Rects, list[str]]:
    """Size of the page, black rectangles, lines and texts of an SVG, mm."""
    root = xml.fromstring(data)
    space = "{http://www.w3.org/2000/svg}"
    width, height = (float(root.get(key, "").removesuffix("mm")) for key in ("width", "height"))
    assert root.get("viewBox") == f"0 0 {width:g} {height:g}"
    rects = []
    for path in root.iter(f"{space}path"):
        for found in re.finditer(r"M(\S+) ([^h]+)h([^v]+)v([^h]+)h[^z]+z", path.get("d", "")):
            x, y, w, h = map(float, found.groups())
            rects.append((x, y, w, h))
    lines = [tuple(float(line.get(key, "")) for key in ("x1", "y1", "x2", "y2")) for line in root.iter(f"{space}line")]
    return (width, height), rects, lines, [it.text or "" for it in root.iter(f"{space}text")]


def of_pdf(data: bytes) -> tuple[tuple[float, float], Rects, Rects, list[str]]:
    """The same of a PDF, whose page has its own unit."""
    text = data.decode("latin-1")
    # The table of objects points to them.
    start = int(text.split("startxref")[1].split()[0])
    assert data[start : start + 4] == b"xref"
    for number, line in enumerate(text[start:].splitlines()[3:8], 1):
        assert text[int(line.split()[0]) :].startswith(f"{number} 0 obj")
    assert "/PrintScaling /None" in text
    box = [float(it) for it in re.search(r"/MediaBox \[([^\]]+)\]", text)[1].split()]  # type: ignore[index]
    stream = text.split(">>\nstream\n")[1].split("\nendstream")[0]
    assert len(stream) == int(re.search(r"/Length (\d+)", text)[1])  # type: ignore[index]
    scale, _, _, flip, _, top = map(float, stream.splitlines()[0].split()[:6])
    assert scale == pytest.approx(72 / 25.4) and flip == -scale and top == pytest.approx(box[3])
    rects = [tuple(map(float, it.groups())) for it in re.finditer(r"^(\S+) (\S+) (\S+) (\S+) re$", stream, re.M)]
    lines = [tuple(map(float, it.groups())) for it in re.finditer(r"(\S+) (\S+) m (\S+) (\S+) l S$", stream, re.M)]
    texts = [it[1].replace("\\(", "(").replace("\\)", ")") for it in re.finditer(r"Tm \((.*)\) Tj", stream)]
    return (box[2] / scale, box[3] / scale), rects, lines, texts


PER_MM = 8


def rastered(size: tuple[float, float], rects: Rects) -> np.ndarray:
    image = np.full((round(size[1] * PER_MM), round(size[0] * PER_MM)), 255, np.uint8)
    for x, y, w, h in rects:
        image[round(y * PER_MM) : round((y + h) * PER_MM), round(x * PER_MM) : round((x + w) * PER_MM)] = 0
    return image


@pytest.mark.parametrize("target", TARGETS, ids=lambda it: f"{it.kind}-{it.family}-{len(it.tags)}")
def test_prints_are_in_true_scale_and_readable(target: Target) -> None:
    drawn = [of_svg(page(target)), of_pdf(page(target, form="pdf"))]
    for (width, height), rects, lines, texts in drawn:
        assert sorted((width, height)) == pytest.approx([210, 297], abs=1e-3)
        assert any(abs(x2 - x1 - 100) < 1e-3 and y1 == y2 for x1, y1, x2, y2 in lines), "the ruler"
        assert target.family in texts[0] and target.name in texts[0]
        detection = detect(rastered((width, height), rects), target)
        assert set(detection.names) == set(target.point_names), detection.rejections
        # Distances in the picture are those of the description, where the print is flat.
        for side in target.sides():
            its = detection.of(side)
            mm = (its.pixels + 0.5) / PER_MM
            for i in range(len(mm)):
                for j in range(i):
                    truth = np.linalg.norm(its.points_m[i] - its.points_m[j]) * 1e3
                    assert abs(np.linalg.norm(mm[i] - mm[j]) - truth) < 0.15
        if target.kind != "cube":
            x, y = (detection.pixels - detection.pixels.mean(axis=0)).T @ detection.points_m[:, :2]
            assert x[0] > 0 > y[1], "x is to the right, y is up"
    (_, its, _, words), (_, others, _, same) = drawn
    assert np.allclose(its, others, atol=2e-4) and words == same


def test_a_cubes_net_folds_to_the_cube() -> None:
    """Points where faces touch in the net are one point of the cube, and folds go away from who looks."""
    target = Target.cube({**CUBE, "bottom": 5}, 0.045, 0.03)
    size, rects, *_ = of_svg(page(target))
    detection = detect(rastered(size, rects), target)
    places: list[tuple[np.ndarray, np.ndarray]] = []
    touching = 0
    for side in target.sides():
        its = detection.of(side)
        mm, points = (its.pixels + 0.5) / PER_MM, its.points_m
        # The face's corners from its tag's: the face is larger by 45 / 30.
        corners = list(zip((mm - mm.mean(0)) * 1.5 + mm.mean(0), (points - points.mean(0)) * 1.5 + points.mean(0)))
        for pixel, point in corners:
            for other, place in places:
                if np.abs(pixel - other).max() < 1.0:
                    touching += 1
                    assert np.abs(place - point).max() < 2e-4
        places += corners
    assert touching == 14, "five edges of two points, and those at the top's corners meet each other too"


def test_a_mark_says_which_side_is_up() -> None:
    root = xml.fromstring(page(Target.tag(3, 0.04)))
    (shape,) = root.iter("{http://www.w3.org/2000/svg}polygon")
    points = [tuple(map(float, it.split(","))) for it in shape.get("points", "").split()]
    _, rects, _, texts = of_svg(page(Target.tag(3, 0.04)))
    tip = min(points, key=lambda it: it[1])
    assert max(y for _, y in points) < min(y for _, y, _, _ in rects) - 4 and tip[1] < points[1][1]
    assert any(it.startswith("UP") for it in texts)


def test_descriptions_are_read_as_they_are_written(tmp_path: Path) -> None:
    for target in TARGETS:
        text = target.to_toml(tmp_path / "target.toml")
        again = Target.read(tmp_path / "target.toml")
        assert again == target and again.to_toml() == text
        assert np.allclose(again.points_m, target.points_m)
    assert len(FAMILIES) == 22


TAG = Target.tag(3, 0.04).to_toml()
POINTS = "[[-0.02, 0.02, 0.0], [0.02, 0.02, 0.0], [0.02, -0.02, 0.0], [-0.02, -0.02, 0.0]]"


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ("[[0.02, 0.02, 0.0], [-0.02, 0.02, 0.0], [-0.02, -0.02, 0.0], [0.02, -0.02, 0.0]]", "mirrored"),
        ("[[-0.02, -0.02, 0.0], [0.02, -0.02, 0.0], [0.02, 0.02, 0.0], [-0.02, 0.02, 0.0]]", "mirrored"),
        ("[[-0.02, 0.02, 0.0], [0.02, -0.02, 0.0], [0.02, 0.02, 0.0], [-0.02, -0.02, 0.0]]", "do not fit"),
        ("[[-0.025, 0.025, 0.0], [0.025, 0.025, 0.0], [0.025, -0.025, 0.0], [-0.025, -0.025, 0.0]]", "1.25 times as large"),
        ("[[-20, 20, 0], [20, 20, 0], [20, -20, 0], [-20, -20, 0]]", "1000 times as large"),
        ("[[-0.02, 0.02, 0.0], [0.02, 0.02, 0.0], [0.02, -0.02, 0.0]]", "not the 4 points"),
        ("[[-0.02, 0.02, 0.0], [0.02, 0.02, nan], [0.02, -0.02, 0.0], [-0.02, -0.02, 0.0]]", "not the 4 points"),
        ('"all"', "no list"),
    ],
)
def test_points_that_are_not_those_of_the_print_are_told(tmp_path: Path, points: str, said: str) -> None:
    assert POINTS in TAG
    (tmp_path / "tag.toml").write_text(TAG.replace(POINTS, points))
    with pytest.raises(FieldError, match=said) as refused:
        Target.read(tmp_path / "tag.toml")
    assert refused.value.mend


def test_a_cube_with_mirrored_points_is_told(tmp_path: Path) -> None:
    text = TARGETS[4].to_toml()
    mirrored = re.sub(r"\[(-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\]", lambda it: f"[{-float(it[1])}, {it[2]}, {it[3]}]", text)
    (tmp_path / "cube.toml").write_text(mirrored)
    with pytest.raises(FieldError, match="mirrored"):
        Target.read(tmp_path / "cube.toml")


def test_points_may_be_in_another_frame(tmp_path: Path) -> None:
    # Turned by a quarter about z, and moved.
    moved = "[[0.08, 0.48, 0.1], [0.08, 0.52, 0.1], [0.12, 0.52, 0.1], [0.12, 0.48, 0.1]]"
    (tmp_path / "tag.toml").write_text(TAG.replace(POINTS, moved))
    target = Target.read(tmp_path / "tag.toml")
    assert np.allclose(target.points_m[0], [0.08, 0.48, 0.1]) and np.allclose(target.facing, [0, 0, 1])
    (tmp_path / "again.toml").write_text(target.to_toml())
    assert np.allclose(Target.read(tmp_path / "again.toml").points_m, target.points_m)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("", "printed"),
        ("[printed]\nkind = 'ball'", "printed.kind"),
        ("[printed]\nkind = 'tag'\nid = 3", "printed.size_m"),
        ("[printed]\nkind = 'tag'\nid = 3\nsize_m = 40", "printed.size_m"),
        ("[printed]\nkind = 'tag'\nid = 3\nsize_m = nan", "printed.size_m"),
        ("[printed]\nkind = 'tag'\nid = 3.0\nsize_m = 0.04", "printed.id"),
        ("[printed]\nkind = 'tag'\nid = 3\nsize_mm = 40\nsize_m = 0.04", "printed.size_mm"),
        ("[printed]\nkind = 'tag'\nid = 3\nsize_m = 0.04\nfamily = 'tag36h12'", "printed.family"),
        ("[printed]\nkind = 'tag'\nid = 3\nsize_m = 0.04\nname = 'a b'", "printed.name"),
        ("[printed]\nkind = 'cube'\nids = [1]\nedge_m = 0.05\nsize_m = 0.03", "printed.ids"),
        ("[printed]\nkind = 'cube'\nids = { lid = 1 }\nedge_m = 0.05\nsize_m = 0.03", "printed.ids"),
        ("[printed]\nkind = 'cube'\nids = { top = 1, left = 1 }\nedge_m = 0.05\nsize_m = 0.03", "printed.ids"),
        ("[printed]\nkind = 'cube'\nids = { top = 1 }\nedge_m = 0.05\nsize_m = 0.049", "printed.size_m"),
        ("[printed]\nkind = 'charuco'\ncolumns = 2\nrows = 5\nsquare_m = 0.03\nsize_m = 0.02", "printed.columns"),
        ("[printed]\nkind = 'charuco'\ncolumns = 5\nrows = 5\nsquare_m = 0.03\nsize_m = 0.03", "printed.size_m"),
        ("[printed]\nkind = 'charuco'\ncolumns = 20\nrows = 20\nsquare_m = 0.03\nsize_m = 0.02", "printed.family"),
        ("[printed\n", "target"),
        (TAG.replace('name = "tag"\npoints', 'name = "other"\npoints'), "target"),
    ],
)
def test_wrong_descriptions_are_refused(tmp_path: Path, text: str, field: str) -> None:
    (tmp_path / "target.toml").write_text(text)
    with pytest.raises(FieldError) as refused:
        Target.read(tmp_path / "target.toml")
    assert refused.value.field == field and refused.value.mend


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "tag.pdf"
    assert main(["print-target", "tag", str(out), "--id", "3", "--dry-run"]) == 0
    assert list(tmp_path.iterdir()) == [] and "[printed]" in capsys.readouterr().out
    assert main(["print-target", "tag", str(out), "--id", "3"]) == 0
    assert out.read_bytes().startswith(b"%PDF") and Target.read(tmp_path / "tag.toml") == Target.tag(3, 0.04)
    assert main(["print-target", "tag", str(out), "--id", "3"]) == 0, "the same again is no loss"
    # A description that is another is kept.
    assert main(["print-target", "tag", str(out), "--id", "4"]) == 2
    assert "--force" in capsys.readouterr().err and Target.read(tmp_path / "tag.toml").tags[0].id == 3
    # What a printer made of it.
    assert main(["print-target", "tag", str(out), "--id", "3", "--measured-ruler-mm", "97", "--force"]) == 0
    assert Target.read(tmp_path / "tag.toml").size_m == pytest.approx(0.0388)
    for wrong, said in [
        (["tag", "tag.png"], ".pdf"),
        (["tag", "tag.pdf", "--rows", "3"], "--rows"),
        (["tag", "tag.pdf", "--size-mm", "400"], "a larger paper"),
        (["tag", "tag.pdf", "--size-mm", "0.04"], "`--size-mm`: 4e-05 is no length"),
        (["tag", "tag.pdf", "--id", "9999"], "0 to 586"),
        (["tag", "tag.pdf", "--measured-ruler-mm", "3.9"], "--measured-ruler-mm"),
        (["cube", "cube.pdf", "--ids", "top"], "top=0"),
        (["charuco", "b.pdf", "--family", "tag99"], "tag36h11"),
        (["tag", str(tmp_path / "tag.toml" / "tag.pdf")], "tag.toml"),
    ]:
        assert main(["print-target", *wrong]) == 2, wrong
        assert said in capsys.readouterr().err


def without_extras(code: str) -> subprocess.CompletedProcess[str]:
    """Python in which no extra can be imported."""
    block = "import sys\nfor name in ('numpy', 'cv2', 'yaml'): sys.modules[name] = None\n"
    where = str(Path(body_schema.__file__).parents[1])
    return subprocess.run([sys.executable, "-c", block + code], capture_output=True, text=True, env=os.environ | {"PYTHONPATH": where})


def test_help_needs_no_extra_and_a_missing_one_is_told() -> None:
    ran = without_extras("import body_schema, body_schema.__main__ as m; m.main(['--help'])")
    assert ran.returncode == 0 and "print-target" in ran.stdout, ran.stderr
    for command in ("print-target", "intrinsics", "detect"):
        ran = without_extras(f"import body_schema.__main__ as m; m.main(['{command}', '--help'])")
        assert ran.returncode == 0 and "usage" in ran.stdout, ran.stderr
    ran = without_extras("import body_schema.__main__ as m; raise SystemExit(m.main(['print-target', 'tag', 'a.pdf']))")
    assert ran.returncode == 2 and "pip install 'body-schema[vision]'" in ran.stderr and "Traceback" not in ran.stderr
    ran = without_extras("import body_schema.vision")
    assert "pip install 'body-schema[vision]'" in ran.stderr.splitlines()[-1]


def test_everything_of_vision_that_is_public_is_documented() -> None:
    from body_schema import vision

    for name in vision.__all__:
        public = getattr(vision, name)
        assert name == "FAMILIES" or inspect.getdoc(public), name
        if inspect.isclass(public):
            for member, value in inspect.getmembers(public):
                if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                    assert inspect.getdoc(value), f"{name}.{member}"


def test_unknown_commands_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in ([], ["print"], ["print-target"], ["detect", "a.png"]):
        with pytest.raises(SystemExit) as refused:
            main(wrong)
        assert refused.value.code == 2 and "usage" in capsys.readouterr().err
