"""Vectors and frames. Right-handed, +X right, +Y up, the camera looks along -Z.

Every function takes NumPy arrays or torch tensors and returns the same kind.
Directions point away from the surface; the last axis holds x, y, z.
"""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core import Float
from anyprobe.errors import InputError


def dot(a, b):
    """Compute the scalar product over the last axis, kept as length 1: [..., 3] -> [..., 1]."""
    return (a[..., 0:1] * b[..., 0:1] + a[..., 1:2] * b[..., 1:2]) + a[..., 2:3] * b[..., 2:3]


def normalize(v):
    """Return the unit vector along v; the floor keeps a zero vector from giving NaN."""
    xp = array_namespace(v)
    return v / xp.sqrt(xp.clip(dot(v, v), 1e-20, None))


def reflect(v, n):
    """Mirror v about n, both pointing away from the surface: 2 (v.n) n - v."""
    return 2.0 * dot(v, n) * n - v


def orthonormal_basis(n):
    """Return tangent and bitangent of unit n, [..., 3] each, so that (t, b, n) is right-handed.

    Duff et al., "Building an Orthonormal Basis, Revisited" (JCGT 2017): smooth everywhere but across n_z = 0-.
    """
    xp = array_namespace(n)
    x, y, z = n[..., 0], n[..., 1], n[..., 2]
    sign = xp.where(z >= 0, xp.ones_like(z), -xp.ones_like(z))
    a = -1.0 / (sign + z)
    b = x * y * a
    tangent = xp.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    bitangent = xp.stack([b, sign + y * y * a, -y], axis=-1)
    return tangent, bitangent


def world_from_local(v, n):
    """Rotate v from the frame whose +Z is n to the frame that n is given in."""
    t, b = orthonormal_basis(n)
    return v[..., 0:1] * t + v[..., 1:2] * b + v[..., 2:3] * n


def rotation_x(angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the active rotation about +X by angle [radians], [3, 3]; positive tips -Z towards +Y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_y(angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the active rotation about +Y by angle [radians], [3, 3]; positive turns -Z towards -X."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_z(angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the active rotation about +Z by angle [radians], [3, 3]; positive turns +X towards +Y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def world_from_camera(yaw: float, elevation: float, roll: float = 0.0) -> Float[np.ndarray, "3 3"]:
    """Return the rotation of a camera that looks at the origin from yaw and elevation [radians], [3, 3].

    At yaw 0, elevation 0 it stands at +Z and looks along -Z; a positive elevation raises the camera, so that it looks
    down.
    """
    return rotation_y(yaw) @ rotation_x(-elevation) @ rotation_z(roll)


def rotation_of(numbers) -> Float[np.ndarray, "3 3"]:
    """Build world_from_camera [3, 3] from yaw, elevation and perhaps roll [degrees], or from nine numbers row by
    row."""
    return np.reshape(numbers, (3, 3)) if len(numbers) == 9 else world_from_camera(*np.radians(numbers))


def turn_towards(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the shortest rotation that carries -Z to the unit vector direction, [3, 3].

    This is how a camera is turned from the optical axis towards an object away
    from the picture's centre, with no roll of its own (Rodrigues' formula).
    """
    forward = np.array([0.0, 0.0, -1.0])
    target = np.asarray(direction, dtype=np.float64)
    target = target / np.linalg.norm(target)
    axis = np.cross(forward, target)
    cosine = float(forward @ target)
    if cosine < -1.0 + 1e-9:
        return rotation_y(np.pi)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + k + k @ k / (1.0 + cosine)


def is_rotation(matrix: np.ndarray) -> bool:
    """Return whether a matrix is [3, 3] and turns without mirroring or scaling, to a thousandth."""
    matrix = np.asarray(matrix, dtype=np.float64)
    is_rigid = matrix.shape == (3, 3) and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-3)
    return is_rigid and bool(np.linalg.det(matrix) > 0)


def check_pose(pose: np.ndarray, subject: str) -> Float[np.ndarray, "3 3"]:
    """Return the rotation [3, 3] float64 of a pose, [3, 3] or [4, 4] whose last row is 0 0 0 1.

    Raises:
        InputError: not a rotation; a mirrored or scaled matrix would bend the light. subject: the pose's keyword.
    """
    try:
        matrix = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    is_whole = matrix.shape == (4, 4) and np.allclose(matrix[3], (0, 0, 0, 1), atol=1e-3)
    rotation = matrix[:3, :3] if is_whole else matrix
    if not (np.isfinite(rotation).all() and is_rotation(rotation)):
        raise InputError(
            f"expected a rotation of unit scale, [3, 3] or [4, 4] with the last row 0 0 0 1, got "
            f"{' '.join(str(pose).split())[:120]}, perhaps mirrored; leave the scale out, or transpose columns",
            subject=subject,
        )
    return rotation
