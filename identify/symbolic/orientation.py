"""Orientation of a pose by direction cosines, Euler angles, roll-pitch-yaw and quaternion, and back.

Euler angles: Rot(z, φ) Rot(x, θ) Rot(z, ψ). Roll-pitch-yaw: Rot(z, roll) Rot(y, pitch) Rot(x, yaw), the roll
about z as Khalil & Dombre (1999) name it. Quaternion: Q1 = cos(θ/2), (Q2, Q3, Q4) = sin(θ/2)·axis, Q1 ≥ 0.
All work on stacks (…, 3, 3). Where only a sum of two angles is determined, the last one is 0.
"""

from __future__ import annotations

import numpy as np

SINGULAR = 1e-12
"""Sine [1] (Euler) or cosine (roll-pitch-yaw) of the middle angle below which the outer two act about one axis."""


def direction_cosines(pose: np.ndarray) -> np.ndarray:
    """(…, 12) Px Py Pz s n a of poses (…, 4, 4), the X of [2.8]."""
    columns = np.swapaxes(np.asarray(pose, dtype=float)[..., :3, :], -1, -2)
    shape = columns.shape[:-2]
    return np.concatenate([columns[..., 3, :], columns[..., :3, :].reshape(*shape, 9)], axis=-1)


def from_direction_cosines(coordinates: np.ndarray) -> np.ndarray:
    """(…, 4, 4) pose of X: (…, 12) P s n a [2.8], or (…, 9) P n a with s = n × a [2.9]."""
    x = np.asarray(coordinates, dtype=float)
    p = x[..., :3]
    if x.shape[-1] == 9:
        n, a = x[..., 3:6], x[..., 6:9]
        s = np.cross(n, a)
    else:
        s, n, a = x[..., 3:6], x[..., 6:9], x[..., 9:12]
    pose = np.zeros((*x.shape[:-1], 4, 4))
    pose[..., :3, :] = np.stack([s, n, a, p], axis=-1)
    pose[..., 3, 3] = 1.0
    return pose


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """(…, 3, 3) rotation by `angle` about axis 0, 1 or 2."""
    angle = np.asarray(angle, dtype=float)
    c, s = np.cos(angle), np.sin(angle)
    result = np.zeros((*angle.shape, 3, 3))
    i, k = (axis + 1) % 3, (axis + 2) % 3
    result[..., axis, axis] = 1.0
    result[..., i, i] = result[..., k, k] = c
    result[..., k, i], result[..., i, k] = s, -s
    return result


def euler(rotation: np.ndarray) -> np.ndarray:
    """(…, 3) Euler angles φ, θ in [0, π], ψ [rad] of rotations (…, 3, 3)."""
    a = np.asarray(rotation, dtype=float)
    sine = np.hypot(a[..., 0, 2], a[..., 1, 2])
    regular = sine > SINGULAR
    phi = np.where(regular, np.arctan2(a[..., 0, 2], -a[..., 1, 2]), np.arctan2(a[..., 1, 0], a[..., 0, 0]))
    theta = np.arctan2(sine, a[..., 2, 2])
    c, s = np.cos(phi), np.sin(phi)
    # ψ from what Rot(z, −φ) leaves, so that the three angles fit together however small sin θ is.
    psi = np.arctan2(-c * a[..., 0, 1] - s * a[..., 1, 1], c * a[..., 0, 0] + s * a[..., 1, 0])
    return np.stack([phi, theta, np.where(regular, psi, 0.0)], axis=-1)


def from_euler(angles: np.ndarray) -> np.ndarray:
    """(…, 3, 3) Rot(z, φ) Rot(x, θ) Rot(z, ψ) of angles (…, 3) [rad]."""
    angles = np.asarray(angles, dtype=float)
    return _about(2, angles[..., 0]) @ _about(0, angles[..., 1]) @ _about(2, angles[..., 2])


def roll_pitch_yaw(rotation: np.ndarray) -> np.ndarray:
    """(…, 3) roll about z, pitch about y in [−π/2, π/2], yaw about x [rad] of rotations (…, 3, 3)."""
    a = np.asarray(rotation, dtype=float)
    cosine = np.hypot(a[..., 0, 0], a[..., 1, 0])
    regular = cosine > SINGULAR
    roll = np.where(regular, np.arctan2(a[..., 1, 0], a[..., 0, 0]), np.arctan2(-a[..., 0, 1], a[..., 1, 1]))
    pitch = np.arctan2(-a[..., 2, 0], cosine)
    c, s = np.cos(roll), np.sin(roll)
    yaw = np.arctan2(s * a[..., 0, 2] - c * a[..., 1, 2], -s * a[..., 0, 1] + c * a[..., 1, 1])
    return np.stack([roll, pitch, np.where(regular, yaw, 0.0)], axis=-1)


def from_roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """(…, 3, 3) Rot(z, roll) Rot(y, pitch) Rot(x, yaw) of angles (…, 3) [rad]."""
    angles = np.asarray(angles, dtype=float)
    return _about(2, angles[..., 0]) @ _about(1, angles[..., 1]) @ _about(0, angles[..., 2])


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(…, 4) quaternion Q1 … Q4, Q1 ≥ 0, of rotations (…, 3, 3): its largest component first, no small divisor."""
    a = np.asarray(rotation, dtype=float)
    xx, yy, zz = a[..., 0, 0], a[..., 1, 1], a[..., 2, 2]
    x, y, z = a[..., 2, 1] - a[..., 1, 2], a[..., 0, 2] - a[..., 2, 0], a[..., 1, 0] - a[..., 0, 1]
    xy, xz, yz = a[..., 0, 1] + a[..., 1, 0], a[..., 0, 2] + a[..., 2, 0], a[..., 1, 2] + a[..., 2, 1]
    # Row k is 4·Q_k·Q.
    rows = np.stack(
        [
            np.stack([1 + xx + yy + zz, x, y, z], axis=-1),
            np.stack([x, 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([y, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([z, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def from_quaternion(q: np.ndarray) -> np.ndarray:
    """(…, 3, 3) rotation of quaternions (…, 4); they are brought to norm 1."""
    q = np.asarray(q, dtype=float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = (q[..., k] for k in range(4))
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
