"""Compiled kernels: vectors of three numbers, as tuples, which cost no more than the numbers."""

import math

from anyprobe_train.world.march import compiled


@compiled
def vector(numbers, k):
    """Return the three numbers of a flat array from k on."""
    return numbers[k], numbers[k + 1], numbers[k + 2]


@compiled
def row_of(rows, k):
    """Return row k of an array [N, 3]."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


@compiled
def add_to(rows, k, a):
    """Add a vector to row k of an array [N, 3]."""
    rows[k, 0] += a[0]
    rows[k, 1] += a[1]
    rows[k, 2] += a[2]


@compiled
def minus(a, b):
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def times(a, b):
    """Return the products of the numbers of both."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@compiled
def scaled(t, a):
    """Return t a."""
    return t * a[0], t * a[1], t * a[2]


@compiled
def moved(a, t, b):
    """Return a + t b."""
    return a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]


@compiled
def dot(a, b):
    """Return a.b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def unit(a):
    """Return a vector's direction."""
    length = math.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


@compiled
def mixed(x, y, z, a, b, c):
    """Return x a + y b + z c."""
    return x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2]


@compiled
def basis(n):
    """Return two unit vectors across a unit one."""
    sign = 1.0 if n[2] >= 0 else -1.0
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return (1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]), (b, sign + n[1] * n[1] * a, -n[1])


@compiled
def between(x, y, a, b, c, d):
    """Return what lies between a and b, x of the way, and the same of c and d below them, y of the way down."""
    low = mixed((1 - x) * (1 - y), x * (1 - y), (1 - x) * y, a, b, c)
    return moved(low, x * y, d)
