"""Rigid motions as the files of drivers write them: rotations as roll, pitch, yaw, as quaternions, as angles about a sequence of axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

EYE: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

LOCKED = 1e-13
"""Below this sine or cosine of the middle angle the outer two turn about the same axis as far as digits tell."""


def vector(values: Sequence[float]) -> Vector:
    """Three numbers as a vector."""
    x, y, z = values
    return (float(x), float(y), float(z))


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """The scalar product."""
    return math.fsum(p * q for p, q in zip(a, b))


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a: Sequence[float]) -> Vector:
    """The vector of length 1 in the same direction."""
    length = math.hypot(*a)
    return vector([it / length for it in a])


def transposed(m: Matrix) -> Matrix:
    """The transposed matrix, a rotation's inverse."""
    return (vector([row[0] for row in m]), vector([row[1] for row in m]), vector([row[2] for row in m]))


def times(m: Matrix, n: Matrix) -> Matrix:
    """The product of two matrices."""
    columns = transposed(n)
    return (
        vector([dot(m[0], it) for it in columns]),
        vector([dot(m[1], it) for it in columns]),
        vector([dot(m[2], it) for it in columns]),
    )


def turned(m: Matrix, v: Sequence[float]) -> Vector:
    """A matrix times a vector."""
    return (dot(m[0], v), dot(m[1], v), dot(m[2], v))


@dataclass(frozen=True)
class Pose:
    """A rigid motion p → ``rotation`` p + ``at``: the place (m) and the rotation (3 × 3) of a frame in another one."""

    rotation: Matrix = EYE
    at: Vector = (0.0, 0.0, 0.0)

    def __matmul__(self, other: Pose) -> Pose:
        moved = turned(self.rotation, other.at)
        return Pose(times(self.rotation, other.rotation), vector([a + b for a, b in zip(self.at, moved)]))

    def inverse(self) -> Pose:
        """The motion back."""
        back = transposed(self.rotation)
        return Pose(back, vector([-it for it in turned(back, self.at)]))


def about(axis: Sequence[float], angle: float) -> Matrix:
    """The rotation about an axis of any length by an angle (rad)."""
    x, y, z = unit(axis)
    # Half angles keep all digits of small rotations.
    s, half = math.sin(angle), 2 * math.sin(angle / 2) ** 2
    c = 1.0 - half
    return (
        (c + half * x * x, half * x * y - s * z, half * x * z + s * y),
        (half * x * y + s * z, c + half * y * y, half * y * z - s * x),
        (half * x * z - s * y, half * y * z + s * x, c + half * z * z),
    )


def rotation_vector(m: Matrix) -> Vector:
    """The axis of a rotation times its angle (rad)."""
    w, x, y, z = quaternion(m)
    s = math.hypot(x, y, z)
    scale = 2.0 if s < 1e-12 else 2 * math.atan2(s, w) / s
    return (x * scale, y * scale, z * scale)


def of_quaternion(wxyz: Sequence[float]) -> Matrix:
    """The rotation of a quaternion w, x, y, z of any length."""
    length = math.hypot(*wxyz)
    w, x, y, z = (it / length for it in wxyz)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def quaternion(m: Matrix) -> tuple[float, float, float, float]:
    """The quaternion w, x, y, z of a rotation, with w ≥ 0."""
    # The largest of the four is taken by its square, so that none is lost to cancellation.
    squares = [1 + m[0][0] + m[1][1] + m[2][2]]
    squares += [1 + 2 * m[k][k] - m[0][0] - m[1][1] - m[2][2] for k in range(3)]
    k = max(range(4), key=squares.__getitem__)
    a, b, c = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    d, e, f = m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]
    row = [(squares[0], a, b, c), (a, squares[1], d, e), (b, d, squares[2], f), (c, e, f, squares[3])][k]
    length = math.hypot(*row) * (-1 if row[0] < 0 else 1)
    w, x, y, z = (it / length for it in row)
    return (w, x, y, z)


def angle_between(m: Matrix, n: Matrix) -> float:
    """The angle (rad) of the rotation from one frame to the other."""
    w, x, y, z = quaternion(times(transposed(m), n))
    return 2 * math.atan2(math.hypot(x, y, z), w)


def least_turn(a: Sequence[float], b: Sequence[float]) -> Matrix:
    """The smallest rotation that takes one direction to the other; they must not be opposite."""
    a, b = unit(a), unit(b)
    normal = cross(a, b)
    s = math.hypot(*normal)
    return EYE if s == 0.0 else about(normal, math.atan2(s, dot(a, b)))


def euler_order(sequence: str) -> tuple[list[int], list[int]]:
    """The order in which angles of a sequence are multiplied: which of them come from left to right, and their axes.

    A small letter turns about the moving frame's axis, a capital about the fixed one's, as MuJoCo reads ``eulerseq``.
    """
    places: list[int] = []
    for index, letter in enumerate(sequence):
        places = [*places, index] if letter.islower() else [index, *places]
    return places, ["xyz".index(sequence[index].lower()) for index in places]


def of_euler(sequence: str, angles: Sequence[float]) -> Matrix:
    """The rotation of three angles (rad) about a sequence of axes as ``xyz`` (moving frame) or ``XYZ`` (fixed frame)."""
    m = EYE
    for place, axis in zip(*euler_order(sequence)):
        m = times(m, about(EYE[axis], angles[place]))
    return m


def euler(sequence: str, m: Matrix, near: Sequence[float]) -> Vector:
    """The angles (rad) about a sequence of axes that are nearest to ``near`` among all that give a rotation."""
    places, (i, j, k) = euler_order(sequence)
    third = 3 - i - j
    sign = 1.0 if (i, j, third) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    wanted = [near[place] for place in places]
    if i != k:
        sine, cosine = -sign * m[j][k], m[k][k]
    else:
        sine, cosine = m[j][i], -sign * m[third][i]
    first = wanted[0] if math.hypot(sine, cosine) < LOCKED else math.atan2(sine, cosine)
    # What is left are two rotations, and gives both angles with all digits however near to gimbal lock.
    rest = times(about(EYE[i], -first), m)
    if i != k:
        second, last = math.atan2(sign * rest[i][k], rest[k][k]), math.atan2(sign * rest[j][i], rest[j][j])
        other = [first + math.pi, math.pi - second, last + math.pi]
    else:
        second, last = math.atan2(-sign * rest[third][i], rest[i][i]), math.atan2(-sign * rest[j][third], rest[j][j])
        other = [first + math.pi, -second, last + math.pi]
    best = min(
        ([angle + math.tau * round((to - angle) / math.tau) for angle, to in zip(its, wanted)] for its in ([first, second, last], other)),
        key=lambda its: sum(abs(angle - to) for angle, to in zip(its, wanted)),
    )
    angles = [0.0, 0.0, 0.0]
    for place, angle in zip(places, best):
        angles[place] = angle
    return vector(angles)


def of_rpy(rpy: Sequence[float]) -> Matrix:
    """The rotation Rz(yaw) Ry(pitch) Rx(roll) of roll, pitch and yaw (rad)."""
    return of_euler("XYZ", rpy)


def rpy_of(m: Matrix, near: Sequence[float] = (0.0, 0.0, 0.0)) -> Vector:
    """Roll, pitch and yaw (rad) of a rotation, those nearest to ``near``."""
    return euler("XYZ", m, near)


def number(value: float) -> str:
    """The shortest text that reads back exactly, and that every reader of YAML takes for a number."""
    text = repr(float(value) + 0.0)
    if text.endswith(".0"):
        return text[:-2]
    mantissa, exponent, power = text.partition("e")
    return text if not exponent or "." in mantissa else f"{mantissa}.0e{power}"
