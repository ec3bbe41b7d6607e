"""Where the object of one picture, the key, lies in another one: to a fraction of a pixel, in NumPy alone.

The same in web/src/live/registration.js; both are held to tests/product/cases/registration.json. Numbers in capitals
are the contract's "registration".

**Coordinates.** x right, y down; pixel i covers i to i + 1, its centre is i + .5. A picture is luma (R + 2 G + B) / 4
of the bytes, [H, W], and `offset` is the x, y of its first pixel: of a frame only the window around the object is
read.

**Motion.** A place p of the key lies in the picture at W(p) = c + (x, y) + e^scale R(angle) (p - c), with c the mean
of the centres of the pixels inside the mask (cover > .5) and R(a) (u, v) = (u cos a - v sin a, u sin a + v cos a).

**Levels.** Level 0 is the picture smoothed by [1 2 1] / 4 along rows, then columns (the border repeated); each
further one the means of 2 x 2 pixels (an odd last row or column is left out). Level l's pixel i has its centre at (i
+ .5) 2^l. `fine` is the first level at which the longer side of the mask's box is at most FINE_PX, `coarse` the first
at which it is at most COARSE_PX. Before the first halving both the key's picture and the other one are cut so that
offsets are multiples of 2^coarse.

**Points** of a level: its pixels whose mean cover is over .5 and that have four neighbours in the picture, with
gradient g (half the difference of the neighbours). At most POINTS of them, row by row: those whose |g|^2 is largest
where there are more (of equals any). Each has t, the key's value, and the row (g_x, g_y, g . (-v, u) / r, g . (u, v)
/ r, t, 1), (u, v) its place from c and r the root mean square of |(u, v)| over the pixels inside the mask; g per
pixel of level 0.

**Search** at the level `coarse`: at the start's angle and scale, the key's box grown by `reach` = ceil(SEARCH_REACH *
longer side in cells) is sampled in the picture; of the shifts by whole cells up to `reach` each way the one with the
greatest correlation of the box's covered cells, less PULL * (distance / reach)^2, is taken.

**Alignment** from `coarse` to `fine`, at most STEPS rounds a level: v = the picture's values at W(points), linear
between centres; points outside the picture have weight 0. The rows are fitted to v by weighted least squares, (d, a,
b); weights are 1 / (1 + (e / (SPREAD s))^2) of the residuals e before (1 in the first round) and s = 1.4826 median
|e| over points in the picture, at least LEAST_SPREAD. Then delta = d / a (a at least LEAST_GAIN), its third and
fourth over r, and W becomes W o Delta^-1: angle -= delta_3, scale -= delta_4, (x, y) -= e^scale R(angle) (delta_1,
delta_2). A round that moves no corner by more than DONE_PX of the level's pixels is the last of its level.

**Result.** alike: correlation of v and the fit over the points of the last level, weighted. inside: share of its
points in the picture. error_px: expected shift of the outline, sqrt(trace of the covariance of d / a) times ERROR. It
failed where alike < ALIKE, inside < INSIDE, or the weights' mean < AGREED.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.contract import contract

NUMBERS = contract("registration")
FINE_PX, COARSE_PX, POINTS = NUMBERS["fine_px"], NUMBERS["coarse_px"], NUMBERS["points"]
SEARCH_REACH, PULL = NUMBERS["reach"], NUMBERS["pull"]
STEPS, DONE_PX, SPREAD, LEAST_SPREAD, LEAST_GAIN = (
    NUMBERS[name] for name in ("steps", "done_px", "spread", "least", "least_gain")
)
ALIKE, INSIDE, AGREED, ERROR = (NUMBERS[name] for name in ("alike", "inside", "agreed", "error"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion:
    """x, y: shift in pixels. angle: radians, clockwise as seen. scale: natural logarithm."""

    x: float = 0.0
    y: float = 0.0
    angle: float = 0.0
    scale: float = 0.0

    def matrix(self) -> np.ndarray:
        """[2, 2] e^scale R(angle)."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.exp(self.scale) * np.array([[cos, -sin], [sin, cos]])


@dataclass(frozen=True, kw_only=True, slots=True)
class Registered:
    """Where the key's object is, and how sure that is; see the module."""

    motion: Motion
    alike: float
    inside: float
    agreed: float
    error_px: float

    @property
    def is_sure(self) -> bool:
        return self.alike >= ALIKE and self.inside >= INSIDE and self.agreed >= AGREED


@dataclass(frozen=True, kw_only=True, slots=True)
class Level:
    """places: [N, 2] of the points from c. rows: [N, 6]."""

    places: np.ndarray
    rows: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Key:
    """A picture's object: the mask's centre c [2] and radius r; levels from fine to coarse; cells:
    values and cover [h, w] of the coarse box, and start [2], the place from c of the centre of its first cell."""

    center: np.ndarray
    radius: float
    fine: int
    levels: tuple[Level, ...]
    cells: np.ndarray
    cover: np.ndarray
    start: np.ndarray

    @property
    def coarse(self) -> int:
        return self.fine + len(self.levels) - 1


def luma(rgb: np.ndarray) -> np.ndarray:
    """(R + 2 G + B) / 4 of bytes [H, W, 3], [H, W] float32."""
    part = rgb.astype(np.float32)
    return (part[..., 0] + 2.0 * part[..., 1] + part[..., 2]) / np.float32(4.0)


def begin_key(picture: np.ndarray, mask: np.ndarray, offset: tuple[int, int] = (0, 0)) -> Key:
    """Return the key of a luma picture [H, W] and the cover [H, W] of its object, which must not be empty.

    offset: x, y of their first pixel in the frame.
    """
    rows, columns = np.nonzero(mask > 0.5)
    x, y = columns + 0.5 + offset[0], rows + 0.5 + offset[1]
    center = np.array([x.mean(), y.mean()])
    radius = float(np.sqrt(((x - center[0]) ** 2 + (y - center[1]) ** 2).mean())) or 1.0
    longer = int(max(np.ptp(rows), np.ptp(columns))) + 1
    fine, coarse = (max(0, int(np.ceil(np.log2(longer / most)))) for most in (FINE_PX, COARSE_PX))
    picture, mask, offset = _cut(picture, coarse, offset), _cut(mask, coarse, offset), _aligned(offset, coarse)
    covers, levels = _pyramid(mask.astype(np.float32), coarse), []
    pictures = _pyramid(_smoothed(picture), coarse)
    for level in range(fine, coarse + 1):
        levels.append(_level(pictures[level], covers[level], level, offset, center, radius))
    inside = covers[coarse] > 0.5
    if not inside.any():  # thinner than a cell
        inside = covers[coarse] >= covers[coarse].max()
    rows, columns = np.nonzero(inside)
    box = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
    first = (np.array([columns.min(), rows.min()]) + 0.5) * 2**coarse + offset - center
    return Key(
        center=center,
        radius=radius,
        fine=fine,
        levels=tuple(levels),
        cells=pictures[coarse][box].astype(np.float64),
        cover=inside[box].astype(np.float64),
        start=first,
    )


def locate_key(key: Key, picture: np.ndarray, start: Motion, offset: tuple[int, int] = (0, 0)) -> Registered:
    """Return where the key's object lies in a luma picture [H, W], looked for around `start`."""
    pictures = _pyramid(_smoothed(_cut(picture, key.coarse, offset)), key.coarse)
    offset = _aligned(offset, key.coarse)
    motion = _searched(key, pictures[-1], start, offset)
    found = Registered(motion=motion, alike=0.0, inside=0.0, agreed=0.0, error_px=float("inf"))
    for level in range(key.coarse, key.fine - 1, -1):
        found = _aligned_to(key, key.levels[level - key.fine], pictures[level], found.motion, level, offset)
        if found.inside == 0.0:
            break
    return found


def _aligned_to(
    key: Key, level: Level, picture: np.ndarray, motion: Motion, step: int, offset: tuple[int, int]
) -> Registered:
    """Return the motion mended at one level."""
    weights, moved = np.ones(len(level.rows)), np.inf
    for turn in range(STEPS + 1):
        places = level.places @ motion.matrix().T + key.center + (motion.x, motion.y)
        values, there = sample(picture, (places - offset) / 2.0**step - 0.5)
        if there.sum() < level.rows.shape[1]:
            return Registered(motion=motion, alike=0.0, inside=0.0, agreed=0.0, error_px=float("inf"))
        weights = weights * there
        weighted = level.rows * weights[:, None]
        normal = weighted.T @ level.rows
        normal[np.diag_indices(6)] += 1e-9 * np.trace(normal) + 1e-12
        fit = np.linalg.solve(normal, weighted.T @ values)
        left = values - level.rows @ fit
        spread = max(1.4826 * float(np.median(abs(left[there]))), LEAST_SPREAD)
        gain = max(float(fit[4]), LEAST_GAIN)
        if turn == STEPS or moved <= DONE_PX * 2.0**step:
            break
        delta = fit[:4] / gain
        moved = float(np.hypot(*delta[:2]) + np.hypot(*delta[2:]))
        motion = _composed(motion, delta, key.radius)
        weights = 1.0 / (1.0 + np.square(left / (SPREAD * spread)))
    fitted, total = level.rows @ fit, weights.sum()
    v, f = values - weights @ values / total, fitted - weights @ fitted / total
    alike = float((weights * v) @ f / np.sqrt(max(((weights * v) @ v) * ((weights * f) @ f), 1e-12)))
    covariance = np.linalg.inv(normal)[:4, :4] * float((weights * left) @ left / total)
    return Registered(
        motion=motion,
        alike=alike if fit[4] > 0.0 else 0.0,
        inside=float(there.mean()),
        agreed=float(total / there.sum()),
        error_px=ERROR * float(np.sqrt(np.trace(covariance))) / gain,
    )


def _composed(motion: Motion, delta: np.ndarray, radius: float) -> Motion:
    """W o Delta^-1."""
    turned = Motion(angle=motion.angle - float(delta[2]) / radius, scale=motion.scale - float(delta[3]) / radius)
    x, y = turned.matrix() @ delta[:2]
    return Motion(x=motion.x - float(x), y=motion.y - float(y), angle=turned.angle, scale=turned.scale)


def _searched(key: Key, picture: np.ndarray, start: Motion, offset: tuple[int, int]) -> Motion:
    """Return the start moved by whole cells of the coarse level to where the object is likeliest."""
    height, width = key.cells.shape
    reach, cell = int(np.ceil(SEARCH_REACH * max(height, width))), 2.0**key.coarse
    y, x = np.mgrid[-reach : height + reach, -reach : width + reach]
    grid = np.stack([x, y], axis=-1) * cell + key.start
    places = grid @ start.matrix().T + key.center + (start.x, start.y)
    seen, there = sample(picture, (places - offset).reshape(-1, 2) / cell - 0.5)
    shape = height + 2 * reach, width + 2 * reach
    windows = np.lib.stride_tricks.sliding_window_view(seen.reshape(shape), (height, width))
    known = np.lib.stride_tricks.sliding_window_view(there.reshape(shape).astype(np.float64), (height, width))
    count = key.cover.sum()
    cells = key.cover * (key.cells - (key.cells * key.cover).sum() / count)
    agree, total = (np.einsum("abij,ij->ab", windows, part) for part in (cells, key.cover))
    square = np.einsum("abij,abij,ij->ab", windows, windows, key.cover)
    spread = np.sqrt(np.maximum(square - total**2 / count, 1e-6) * max(float((cells**2).sum()), 1e-6))
    shares = np.einsum("abij,ij->ab", known, key.cover) / count
    shifts = np.arange(-reach, reach + 1)
    away = (shifts[:, None] ** 2 + shifts**2) / reach**2
    alike = np.where(shares >= INSIDE, agree / spread, -1.0) - PULL * away
    row, column = np.unravel_index(int(alike.argmax()), alike.shape)
    x, y = start.matrix() @ (cell * np.array([shifts[column], shifts[row]]))
    return Motion(x=start.x + float(x), y=start.y + float(y), angle=start.angle, scale=start.scale)


def _level(
    picture: np.ndarray, cover: np.ndarray, level: int, offset: tuple[int, int], center: np.ndarray, radius: float
) -> Level:
    down, across = np.zeros_like(picture), np.zeros_like(picture)
    down[1:-1] = (picture[2:] - picture[:-2]) / 2.0 ** (level + 1)
    across[:, 1:-1] = (picture[:, 2:] - picture[:, :-2]) / 2.0 ** (level + 1)
    inside = cover > 0.5
    inside[[0, -1]] = inside[:, [0, -1]] = False
    rows, columns = np.nonzero(inside)
    if len(rows) > POINTS:
        slope = down[rows, columns] ** 2 + across[rows, columns] ** 2
        kept = np.sort(np.argpartition(-slope, POINTS)[:POINTS])
        rows, columns = rows[kept], columns[kept]
    places = (np.stack([columns, rows], axis=-1) + 0.5) * 2.0**level + offset - center
    gx, gy = across[rows, columns].astype(np.float64), down[rows, columns].astype(np.float64)
    u, v = places.T
    turned, grown = (gy * u - gx * v) / radius, (gx * u + gy * v) / radius
    values = picture[rows, columns].astype(np.float64)
    return Level(places=places, rows=np.stack([gx, gy, turned, grown, values, np.ones_like(gx)], axis=-1))


def sample(picture: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values [N] at places [N, 2] (x, y; 0 is the first pixel's centre), linear between pixels, and which are in it."""
    height, width = picture.shape
    x, y = places.T
    there = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    left, top = np.minimum(x.astype(np.intp), max(width - 2, 0)), np.minimum(y.astype(np.intp), max(height - 2, 0))
    x, y = x - left, y - top
    flat, at = picture.ravel(), top * width + left
    right, below = min(1, width - 1), width * min(1, height - 1)
    above = flat[at] * (1 - x) + flat[at + right] * x
    return above * (1 - y) + (flat[at + below] * (1 - x) + flat[at + below + right] * x) * y, there


def _smoothed(picture: np.ndarray) -> np.ndarray:
    for _ in range(2):
        padded = np.pad(picture, ((0, 0), (1, 1)), mode="edge")
        picture = ((padded[:, :-2] + padded[:, 2:] + 2.0 * picture) / np.float32(4.0)).T
    return np.ascontiguousarray(picture)


def _pyramid(picture: np.ndarray, coarse: int) -> list[np.ndarray]:
    levels = [picture]
    for _ in range(coarse):
        last = levels[-1]
        even = last[: len(last) // 2 * 2, : last.shape[1] // 2 * 2]
        levels.append((even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / np.float32(4.0))
    return levels


def _aligned(offset: tuple[int, int], coarse: int) -> tuple[int, int]:
    cell = 2**coarse
    return -(-offset[0] // cell) * cell, -(-offset[1] // cell) * cell


def _cut(picture: np.ndarray, coarse: int, offset: tuple[int, int]) -> np.ndarray:
    """Without the rows and columns before the first offset that is a multiple of 2^coarse."""
    x, y = _aligned(offset, coarse)
    return picture[y - offset[1] :, x - offset[0] :]
