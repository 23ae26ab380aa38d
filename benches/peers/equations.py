"""The equations that every peer is judged by, compiled, in the plate's frame.

State of the compliant ball: position, velocity and spin relative to the plate
(9 numbers). State of the rolling ball: px, py, vx, vy, wz. A law gives
(qx, qy, their rates, their accelerations); R = Rx(qx)·Ry(qy) takes plate to world.
"""

import math

import numpy as np
from numba import njit

GRAVITY = 9.81
RADIUS = 0.0127
MASS = 0.051
SHAPE = 0.4  # moment of inertia over m r²: solid sphere
INERTIA = SHAPE * MASS * RADIUS**2
FRICTION = 0.6
SLIP_LIMIT = 1e-4  # m/s at which friction saturates
REST_HEIGHT = 0.0227

SLOPE, SINE, STEEP = range(3)
RISE = 0.15  # s that the steep plate takes to reach its angle
STEEP_ANGLE = 1.2

START = np.array([0.0, 0.0, REST_HEIGHT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
ROLLING_START = np.zeros(5)

compiled = njit(cache=True, error_model="numpy")


@compiled
def law(kind, t):
    """Angles, rates and accelerations of the plate at t."""
    if kind == SLOPE:
        return math.pi / 20, math.pi / 20, 0.0, 0.0, 0.0, 0.0
    if kind == SINE:
        a, ox, oy = 0.05, 2 * math.pi * 0.7, 2 * math.pi * 0.9
        sx, cx = math.sin(ox * t), math.cos(ox * t)
        sy, cy = math.sin(oy * t + 0.5), math.cos(oy * t + 0.5)
        return a * sx, a * sy, a * ox * cx, a * oy * cy, -a * ox**2 * sx, -a * oy**2 * sy
    if t >= RISE:
        return 0.0, STEEP_ANGLE, 0.0, 0.0, 0.0, 0.0
    u = t / RISE
    rate = 6 * u * (1 - u) * STEEP_ANGLE / RISE
    acceleration = (6 - 12 * u) * STEEP_ANGLE / RISE**2
    return 0.0, STEEP_ANGLE * u * u * (3 - 2 * u), 0.0, rate, 0.0, acceleration


@compiled
def plate(kind, t):
    """Gravity, angular velocity and angular acceleration in the plate's frame."""
    qx, qy, rx, ry, ax, ay = law(kind, t)
    sx, cx, sy, cy = math.sin(qx), math.cos(qx), math.sin(qy), math.cos(qy)
    g = (GRAVITY * cx * sy, -GRAVITY * sx, -GRAVITY * cx * cy)
    turn = (rx * cy, ry, rx * sy)
    turn_rate = (ax * cy - rx * ry * sy, ay, ax * sy + rx * ry * cy)
    return g, turn, turn_rate


@compiled
def cross(a, b):
    """Vector product of two triples."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def clamp(value):
    """Value held between −1 and 1."""
    return min(max(value, -1.0), 1.0)


@compiled
def free_acceleration(p, v, motion):
    """Of a ball that touches nothing, relative to the plate."""
    g, turn, turn_rate = motion
    coriolis, euler = cross(turn, v), cross(turn_rate, p)
    centrifugal = cross(turn, cross(turn, p))
    return (
        g[0] - 2 * coriolis[0] - centrifugal[0] - euler[0],
        g[1] - 2 * coriolis[1] - centrifugal[1] - euler[1],
        g[2] - 2 * coriolis[2] - centrifugal[2] - euler[2],
    )


@compiled
def contact_force(y, stiffness, damping):
    """Spring and damper, and box friction regularised over the slip limit."""
    if y[2] >= REST_HEIGHT:
        return 0.0, 0.0, 0.0
    normal = -stiffness * (y[2] - REST_HEIGHT) - damping * y[5]
    slip_x = -y[3] + RADIUS * y[7]
    slip_y = -y[4] - RADIUS * y[6]
    grip = FRICTION * normal
    return grip * clamp(slip_x / SLIP_LIMIT), grip * clamp(slip_y / SLIP_LIMIT), normal


@compiled
def compliant_into(t, y, out, kind, stiffness, damping):
    """Derivative of the compliant state, into `out`."""
    motion = plate(kind, t)
    a = free_acceleration((y[0], y[1], y[2]), (y[3], y[4], y[5]), motion)
    force = contact_force(y, stiffness, damping)
    carried = cross(motion[1], (y[6], y[7], y[8]))
    torque = (RADIUS * force[1], -RADIUS * force[0], 0.0)
    for i in range(3):
        out[i] = y[3 + i]
        out[3 + i] = a[i] + force[i] / MASS
        out[6 + i] = torque[i] / INERTIA - motion[2][i] - carried[i]


@compiled
def compliant(t, y, kind, stiffness, damping):
    """Derivative of the compliant state."""
    out = np.empty(9)
    compliant_into(t, y, out, kind, stiffness, damping)
    return out


@compiled
def add_cross(matrix, row, column, a, factor):
    """Add `factor` times the matrix of a× at (row, column)."""
    matrix[row, column + 1] -= factor * a[2]
    matrix[row, column + 2] += factor * a[1]
    matrix[row + 1, column] += factor * a[2]
    matrix[row + 1, column + 2] -= factor * a[0]
    matrix[row + 2, column] -= factor * a[1]
    matrix[row + 2, column + 1] += factor * a[0]


@compiled
def add_contact(matrix, y, stiffness, damping):
    """Add the contact's share of the Jacobian."""
    normal = -stiffness * (y[2] - REST_HEIGHT) - damping * y[5]
    slips = (-y[3] + RADIUS * y[7], -y[4] - RADIUS * y[6])
    matrix[5, 2] -= stiffness / MASS
    matrix[5, 5] -= damping / MASS
    for axis in range(2):
        saturation = clamp(slips[axis] / SLIP_LIMIT)
        gradient = np.zeros(9)
        gradient[2] = -FRICTION * saturation * stiffness
        gradient[5] = -FRICTION * saturation * damping
        if abs(slips[axis]) < SLIP_LIMIT:
            slope = FRICTION * normal / SLIP_LIMIT
            gradient[3 + axis] = -slope
            gradient[7 - axis] = slope * RADIUS * (1 - 2 * axis)
        for column in range(9):
            matrix[3 + axis, column] += gradient[column] / MASS
            matrix[7 - axis, column] -= (1 - 2 * axis) * RADIUS / INERTIA * gradient[column]


@compiled
def compliant_jacobian(t, y, kind, stiffness, damping):
    """Derivative of `compliant` by the state."""
    _, turn, turn_rate = plate(kind, t)
    matrix = np.zeros((9, 9))
    square = turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2
    for i in range(3):
        matrix[i, 3 + i] = 1.0
        matrix[3 + i, i] += square
        for j in range(3):
            matrix[3 + i, j] -= turn[i] * turn[j]
    add_cross(matrix, 3, 0, turn_rate, -1.0)
    add_cross(matrix, 3, 3, turn, -2.0)
    add_cross(matrix, 6, 6, turn, -1.0)
    if y[2] < REST_HEIGHT:
        add_contact(matrix, y, stiffness, damping)
    return matrix


@compiled
def rolling_into(t, y, out, kind):
    """Derivative of the rolling state, into `out`."""
    motion = plate(kind, t)
    turn, turn_rate = motion[1], motion[2]
    spin = (-y[3] / RADIUS, y[2] / RADIUS, y[4])
    a = free_acceleration((y[0], y[1], REST_HEIGHT), (y[2], y[3], 0.0), motion)
    carried = cross(turn, spin)
    out[0] = y[2]
    out[1] = y[3]
    out[2] = (a[0] - SHAPE * RADIUS * (turn_rate[1] + carried[1])) / (1 + SHAPE)
    out[3] = (a[1] + SHAPE * RADIUS * (turn_rate[0] + carried[0])) / (1 + SHAPE)
    out[4] = -turn_rate[2] - carried[2]


@compiled
def rolling(t, y, kind):
    """Derivative of the rolling state."""
    out = np.empty(5)
    rolling_into(t, y, out, kind)
    return out
