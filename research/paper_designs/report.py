"""Report: one table, one plot and the answer, of whatever has been trained so far."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from research.paper_designs.judge import clustered_error

HERE = Path(__file__).parent
BEGIN, END = "<!-- results -->", "<!-- end of results -->"
FIGURES = {"rmse": -1, "ssim": 1, "hdr_rmse": -1, "hdr_ssim": 1}
"""And which way is better."""
STEPS = {
    "Direct -> Irradiance": ("direct", "irradiance"),
    "Irradiance -> Ours": ("irradiance", "ours"),
    "Ours -> Ideal": ("ours", "ideal"),
    "Georgoulis -> Ours": ("georgoulis", "ours"),
    "Meka -> Ours": ("meka", "ours"),
    "Ideal -> with true normals": ("ideal", "normals"),
}
"""The worse and the better by the paper; the last is ours."""
IMAGE = ("test/image/rmse", "test/image/ssim", "seen/image/rmse", "seen/image/ssim")
TITLES = {
    "direct": "Direct",
    "irradiance": "Irradiance",
    "ours": "Ours (gradual targets)",
    "ideal": "Ideal (gradual targets)",
    "ideal_on_estimate": "Ideal's network on estimated irradiance",
    "georgoulis": "Georgoulis et al. (mirror sphere)",
    "meka": "Meka et al. (given normals)",
    "normals": "Ceiling: true irradiance and true normals",
    "linear from photo": "Ceiling: ridge from the photo, given shape and material",
    "linear from irradiance": "Ceiling: ridge from the true irradiance, given shape and material",
    "mean map": "Mean of the training maps",
}
SURE = 2.0
"""Standard errors from zero that a step needs, with both seeds, to hold or to be reversed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Point:
    """One evaluation. pairs: of the whole run; after: of those, seen so far; columns: as Judge writes them."""

    pairs: int
    seed: int
    after: int
    columns: dict[str, np.ndarray]


def read_points(folder: Path) -> list[Point]:
    """Every evaluation under folder, by pairs, seed and pairs seen."""
    points = []
    for path in folder.glob("pairs_*_seed_*/after_*.npz"):
        pairs, seed = map(int, re.findall(r"\d+", path.parent.name))
        with np.load(path) as stored:
            columns = {key: stored[key] for key in stored.files}
        points.append(Point(pairs=pairs, seed=seed, after=int(path.stem.split("_")[1]), columns=columns))
    return sorted(points, key=lambda point: (point.pairs, point.seed, point.after))


def latest(points: list[Point]) -> list[Point]:
    """Of the longest run with finished seeds, its last points; of one seed where the other is not done."""
    done = [point for point in points if point.after == point.pairs]
    most = max(point.pairs for point in done)
    return [point for point in done if point.pairs == most]


def step_of(points: list[Point], worse: str, better: str, figure: str) -> dict:
    """Gain of a step pair by pair (positive is better): mean and standard error of each seed and of their mean."""
    where = points[0].columns["test/map"], points[0].columns["test/shape"]
    gains = [
        FIGURES[figure] * (point.columns[f"test/{better}/{figure}"] - point.columns[f"test/{worse}/{figure}"])
        for point in points
    ]
    each = [(float(gain.mean()), clustered_error(gain, *where)) for gain in gains]
    together = np.mean(gains, axis=0)
    return {
        "mean": float(together.mean()),
        "standard_error": clustered_error(together, *where),
        "seeds": [{"mean": mean, "standard_error": error} for mean, error in each],
        "verdict": verdict(each),
    }


def verdict(each: list[tuple[float, float]]) -> str:
    """Of (mean, standard error) a seed: holds or reversed where every one of two seeds or more says so, else open."""
    if len(each) < 2:
        return "one seed"
    if all(mean > SURE * error for mean, error in each):
        return "holds"
    return "reversed" if all(mean < -SURE * error for mean, error in each) else "open"


def results(points: list[Point], ceilings: dict[str, np.ndarray]) -> dict:
    """What the table, the plot and the answer are made of; every number rounded for the file."""
    shown = latest(points)
    return {
        "pairs": shown[0].pairs,
        "seeds": [point.seed for point in shown],
        "test_pairs": len(shown[0].columns["test/map"]),
        "under_way": {f"{p.pairs} seed {p.seed}": p.after for p in points if p.pairs > shown[0].pairs},
        "image": {key: _mean(shown, key) for key in IMAGE},
        "rows": dict(_rows(shown, ceilings)),
        "steps": {
            str(size): {
                name: {figure: step_of(those, *pair, figure) for figure in FIGURES if _has(those, pair, figure)}
                for name, pair in STEPS.items()
            }
            for size, those in _finished(points).items()
        },
        "curves": list(_curves(points)),
    }


def _finished(points: list[Point]) -> dict[int, list[Point]]:
    found: dict[int, list[Point]] = {}
    for point in points:
        if point.after == point.pairs:
            found.setdefault(point.pairs, []).append(point)
    return found


def _has(points: list[Point], names: tuple[str, str], figure: str) -> bool:
    return all(f"test/{name}/{figure}" in points[0].columns for name in names)


def _mean(points: list[Point], key: str) -> float:
    return float(np.mean([point.columns[key].mean() for point in points]))


def _rows(shown: list[Point], ceilings: dict[str, np.ndarray]) -> Iterator[tuple[str, dict[str, float]]]:
    for name in TITLES:
        keys = {f"{split}_{figure}": f"{split}/{name}/{figure}" for split in ("test", "seen") for figure in FIGURES}
        row = {title: _mean(shown, key) for title, key in keys.items() if key in shown[0].columns}
        row |= {f"test_{f}": float(ceilings[f"{name}/{f}"].mean()) for f in FIGURES if f"{name}/{f}" in ceilings}
        if row:
            yield name, row


def _curves(points: list[Point]) -> Iterator[dict]:
    for point in points:
        row = {"pairs": point.pairs, "seed": point.seed, "after": point.after}
        for key, values in point.columns.items():
            if key.startswith("test/") and key.endswith(("/rmse", "/ssim")):
                row[key] = float(values.mean())
        yield row


def write_report(folder: Path, out: Path = HERE) -> None:
    """results.json, curves.png and the README's part between its marks, from the evaluations under folder."""
    points, ceilings = read_points(folder), {}
    if (folder / "ceilings.npz").is_file():
        with np.load(folder / "ceilings.npz") as stored:
            ceilings = {key: stored[key] for key in stored.files}
    content = {"scale": folder.name} | results(points, ceilings)
    rounded = json.loads(json.dumps(content), parse_float=lambda text: round(float(text), 5))
    (out / "results.json").write_text(json.dumps(rounded) + "\n")
    draw(content, out / "curves.png")
    readme = out / "README.md"
    before, rest = readme.read_text().split(BEGIN)
    after = rest.split(END)[1]
    readme.write_text(before + "\n".join([BEGIN, "", *lines(content), "", END]) + after)


def lines(content: dict) -> Iterator[str]:
    """The README's table and answer."""
    seeds = len(content["seeds"])
    count = {1: "one seed", 2: "mean of both seeds"}.get(seeds, f"mean of {seeds} seeds")
    yield f"After {content['pairs']:,} pairs, {count}."
    for name, after in content["under_way"].items():
        yield f"The run of {int(name.split()[0]):,} pairs, {' '.join(name.split()[1:])}, has seen {after:,}."
    yield ""
    yield from _table(content)
    yield ""
    yield "![curves](curves.png)"
    yield ""
    yield from _answer(content)


def _table(content: dict) -> Iterator[str]:
    yield f"{content['test_pairs']:,} test pairs of maps and shapes that no network has seen; beside them, in brackets,"
    yield "500 pairs of maps and shapes that all have seen. HDR figures of all designs, Ideal too, are from their"
    yield "estimated LDR maps; the paper feeds Ideal's HDR network the true one."
    yield ""
    yield "| design | LDR RMSE | LDR SSIM | HDR RMSE, log10 | HDR SSIM |"
    yield "|---|---|---|---|---|"
    for name, row in content["rows"].items():
        cells = []
        for figure in FIGURES:
            seen = f" ({row[f'seen_{figure}']:.4f})" if f"seen_{figure}" in row else ""
            cells.append(f"{row[f'test_{figure}']:.4f}{seen}" if f"test_{figure}" in row else "")
        yield f"| {TITLES[name]} | " + " | ".join(cells) + " |"
    yield ""
    yield "Steps, gain in LDR RMSE and SSIM (positive is better) +- standard error by map and shape, each seed:"
    yield ""
    yield "| step | RMSE | | SSIM | |"
    yield "|---|---|---|---|---|"
    for name, step in content["steps"][str(content["pairs"])].items():
        cells = []
        for figure in ("rmse", "ssim"):
            seeds = [f"{seed['mean']:+.4f} +- {seed['standard_error']:.4f}" for seed in step[figure]["seeds"]]
            cells += ["; ".join(seeds), step[figure]["verdict"]]
        yield f"| {name} | " + " | ".join(cells) + " |"


def _answer(content: dict) -> Iterator[str]:
    image = [content["image"][key] for key in IMAGE]
    yield f"Irradiance image: RMSE {image[0]:.4f}, SSIM {image[1]:.3f} on unseen maps and shapes, {image[2]:.4f} and"
    yield f"{image[3]:.3f} on seen ones; the paper's 0.0449 and 0.950."
    yield ""
    yield "Gain in LDR RMSE by pairs seen, mean of the seeds; **bold** where the step holds, *italic* where reversed:"
    yield ""
    sizes = content["steps"]
    yield "| step | " + " | ".join(f"{int(size):,}" for size in sizes) + " |"
    yield "|---|" + "---|" * len(sizes)
    for name in STEPS:
        yield f"| {name} | " + " | ".join(_marked(steps[name]["rmse"]) for steps in sizes.values()) + " |"


def _marked(step: dict) -> str:
    mark = {"holds": "**", "reversed": "*"}.get(step["verdict"], "")
    return f"{mark}{step['mean']:+.4f}{mark}"


def draw(content: dict, path: Path) -> None:
    """Curves: large marks end runs with a schedule of their own, thin lines are within the longest run."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    shown = ("direct", "irradiance", "ours", "ideal", "normals", "georgoulis", "meka")
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.5))
    for axis, name in zip(axes, ("rmse", "ssim"), strict=True):
        marks: list[float] = []
        for number, design in enumerate(shown):
            key, color = f"test/{design}/{name}", f"C{number}"
            ends = [row for row in content["curves"] if row["after"] == row["pairs"]]
            sizes = sorted({row["pairs"] for row in ends})
            means = [np.mean([row[key] for row in ends if row["pairs"] == size]) for size in sizes]
            axis.plot(sizes, means, "o-", color=color, label=TITLES[design], markersize=4)
            longest = max(row["pairs"] for row in content["curves"])
            inner = [row for row in content["curves"] if row["pairs"] == longest and row["seed"] == 0]
            axis.plot([row["after"] for row in inner], [row[key] for row in inner], color=color, linewidth=0.5)
            marks += means
        for ceiling, style in (("linear from irradiance", "--"), ("linear from photo", ":")):
            if ceiling in content["rows"]:
                height = content["rows"][ceiling][f"test_{name}"]
                axis.axhline(height, color="0.4", linestyle=style, label=TITLES[ceiling])
                marks.append(height)
        room = 0.05 * (max(marks) - min(marks))
        axis.set(xscale="log", xlabel="pairs seen", ylabel=f"LDR map, {name.upper()}, test")
        axis.set_ylim(min(marks) - room, max(marks) + room)  # thin lines begin far outside
    axes[0].legend(fontsize=6, loc="lower left")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)
