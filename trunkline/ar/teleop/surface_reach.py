"""Reach of the tip by sheets, under gravity from any side.

With points p_j of the surface of tips under gravity g_j, under gravity g they are Σ w_j p_j (`reachability.weights`).
The nearest point of all triangles between them is the nearest that the tip reaches. No array library does the sums,
whose order, and so whose last bit, would depend on the processor.
"""

import math

import numpy as np

from trunkline.ar.teleop.reach_message import Reading
from trunkline.ar.teleop.vectors import DOWN, Vector
from trunkline.errors import InputError
from trunkline.kinematics.reachability.workspace_surface import sheet_triangles
from trunkline.model.statics.kernel import kernel

ROUNDING = 1e-6  # of a unit vector, by which gravity may be beyond the last directions


class SheetReach:
    """Gravity further from straight down than any of the directions that are known is "unknown"."""

    def __init__(self, points: np.ndarray, downs: np.ndarray, matrix: np.ndarray, tolerance: float) -> None:
        """
        Args:
            points: m, by direction, way around the arm, place along the tip's way, in the soft arm's base frame
                (D, R, S, 3). downs: directions, unit vectors (D, 3). matrix: of the weights (D, D + 4). tolerance: m.
        """
        count = len(points)
        if np.ndim(points) != 4 or (np.shape(downs), np.shape(matrix)) != ((count, 3), (count, count + 4)):
            shapes = ", ".join(str(np.shape(array)) for array in (points, downs, matrix))
            raise InputError(f"sheets: found points, directions and matrix of {shapes}, expected (D, R, S, 3), (D, 3) "
                             "and (D, D + 4)")  # fmt: skip
        self._points = np.ascontiguousarray(np.reshape(points, (count, -1)), dtype=np.float32)
        self._downs, self._matrix = (np.ascontiguousarray(array, dtype=np.float64) for array in (downs, matrix))
        self._triangles = sheet_triangles(*np.shape(points)[1:3])
        self._tolerance = tolerance
        self._lowest = float(-self._downs[:, 2].max()) - ROUNDING
        self._last = DOWN, self._sheet(DOWN)
        self.read((0.0, 0.0, 0.0), DOWN)  # compiles, so that no step waits for it

    def read(self, tip: Vector, gravity: Vector) -> Reading:
        """As `reach.Reach.soft`."""
        if -gravity[2] < self._lowest:
            return Reading("unknown")
        last_gravity, sheet = self._last
        if gravity != last_gravity:  # gravity mostly stands still; what is kept is what would be computed again
            sheet = self._sheet(gravity)
            self._last = gravity, sheet
        squared, x, y, z = _nearest(sheet, self._triangles, *tip)
        outside = math.sqrt(squared) - self._tolerance
        return Reading("inside") if outside <= 0 else Reading("outside", outside, (x, y, z))

    def _sheet(self, gravity: Vector) -> np.ndarray:
        """Points under `gravity`, m. Shape (R S, 3)."""
        sheet = np.zeros(self._points.shape[1])
        _blend(self._points, self._downs, self._matrix, *gravity, sheet)
        return sheet.reshape(-1, 3)


@kernel
def _blend(points, downs, matrix, x, y, z, sheet):
    count = len(downs)
    terms = np.empty(count + 4)
    for j in range(count):
        a, b, c = x - downs[j, 0], y - downs[j, 1], z - downs[j, 2]
        squared = a * a + b * b + c * c
        terms[j] = squared * math.sqrt(squared)
    terms[count], terms[count + 1], terms[count + 2], terms[count + 3] = 1.0, x, y, z
    for j in range(count):
        weight = 0.0
        for k in range(count + 4):
            weight += matrix[j, k] * terms[k]
        for i in range(len(sheet)):
            sheet[i] += weight * points[j, i]


@kernel
def _nearest(corners, triangles, x, y, z):
    """Square of the distance to the nearest point of all triangles, and that point (Ericson, Real-Time Collision
    Detection, 2005, section 5.1.5)."""
    best, nx, ny, nz = np.inf, 0.0, 0.0, 0.0
    for index in range(len(triangles)):
        i, j, k = triangles[index]
        ax, ay, az = corners[i, 0], corners[i, 1], corners[i, 2]
        bx, by, bz = corners[j, 0] - ax, corners[j, 1] - ay, corners[j, 2] - az
        cx, cy, cz = corners[k, 0] - ax, corners[k, 1] - ay, corners[k, 2] - az
        px, py, pz = x - ax, y - ay, z - az
        bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
        d1, d2 = bx * px + by * py + bz * pz, cx * px + cy * py + cz * pz
        d3, d4, d5, d6 = d1 - bb, d2 - bc, d1 - bc, d2 - cc
        vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
        if d1 <= 0 and d2 <= 0:
            v, w = 0.0, 0.0
        elif d3 >= 0 and d4 <= d3:
            v, w = 1.0, 0.0
        elif d6 >= 0 and d5 <= d6:
            v, w = 0.0, 1.0
        elif vc <= 0 and d1 >= 0 and d3 <= 0:
            v, w = d1 / (d1 - d3), 0.0
        elif vb <= 0 and d2 >= 0 and d6 <= 0:
            v, w = 0.0, d2 / (d2 - d6)
        elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
            w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
            v = 1 - w
        else:
            v, w = vb / (va + vb + vc), vc / (va + vb + vc)
        fx, fy, fz = v * bx + w * cx, v * by + w * cy, v * bz + w * cz
        squared = (px - fx) ** 2 + (py - fy) ** 2 + (pz - fz) ** 2
        if squared < best:
            best, nx, ny, nz = squared, ax + fx, ay + fy, az + fz
    return best, nx, ny, nz
