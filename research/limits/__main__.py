"""python -m research.limits: a model beside the mean map, more given inputs and what a perfect sphere allows."""

from __future__ import annotations

from functools import partial
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.evaluate.methods import GIVEN_HINTS, mean_map, run_with_hints
from anyprobe_train.evaluate.scoring import ALPHA_EDGES
from anyprobe_train.evaluate.scoring import FROZEN as LIST
from research.kept_pairs import kept_pairs
from research.limits.claims import claimed_errors, true_errors
from research.limits.figures import MEAN_MAP, Limits, alpha_bin, kind_of
from research.limits.sphere import SphereLimit, Views, is_world, paper_draw, world_draw
from research.results import commit, write_result
from research.world.pairs import PARTS, world_pairs

FROZEN = "frozen"
SPHERES = {"sphere": False, "sphere, material": True}
"""Rows of the linear limit, and whether the material is given."""
GIVEN = ("normals", "material", "normals and material")
WIDTH = 200


def limits(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri and meshes, train and test.")],
    part: Annotated[str, Parameter(help="Pairs: frozen, or a part of the world test set, test or left-out.")] = "test",
    pairs: Annotated[int, Parameter(help="The first so many."), bounded(1)] = 1000,
    kept: Annotated[Path | None, Parameter(help="Folder that keeps rendered pairs, a folder for each part.")] = None,
    model: Annotated[str, Parameter(help="Bundled model, or a folder of graphs.")] = DEFAULT_MODEL,
    sphere: Annotated[
        bool, Parameter(negative="--no-sphere", help="Also the linear limit of a perfect sphere.")
    ] = True,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Folder for limits-PART.json.")] = Path("runs"),
) -> None:
    """Score a model by kind of material and alpha, with nothing, normals, material and both given."""
    chosen = _pairs(data, part, pairs, kept)
    models, title = Models(model), Path(model).name
    maps = {MEAN_MAP: lambda pair: mean_map(), title: lambda pair: run_with_hints(models, pair, set()).radiance}
    for name in GIVEN:
        maps[f"+ {name}"] = partial(
            lambda pair, given: run_with_hints(models, pair, given).radiance, given=GIVEN_HINTS[name]
        )
    spheres = _Spheres(data, part) if sphere else None
    scores, held = Limits(), {}
    for pair in chosen:
        scores.add(pair, maps)
        said = run_with_hints(models, pair)
        if said.object_material is not None:
            metal = (said.object_material[0] > 0.5) == (not pair.material.albedo.any())
            for group in ("all", kind_of(pair)):
                held.setdefault(group, []).append([*(true_errors(said, pair) <= claimed_errors(said)), metal])
        if spheres is not None:
            for name, ldr in spheres(pair).items():
                scores.add_ldr(name, pair, ldr)
    table = scores.table()
    content = {
        "commit": commit(),
        "command": f"python -m research.limits --data DATA --part {part} --pairs {len(scores.groups)}"
        + ("" if sphere else " --no-sphere")
        + ("" if model == DEFAULT_MODEL else f" --model {title}"),
        "model": model_id(model),
        "groups": table,
        "claims": {group: [round(float(share), 3) for share in np.mean(rows, axis=0)] for group, rows in held.items()},
    }
    write_result(out / f"limits-{part}.json", content)
    show(table)
    for group, shares in content["claims"].items():
        print(group, "within its claims of reflectance, level, colour; metal or not:", *shares)


def _pairs(data: Path, part: str, count: int, kept: Path | None):
    if part not in (FROZEN, *PARTS):
        raise InputError(
            f"expected {', '.join((FROZEN, *PARTS))}, got another; choose one of them", subject="part", source=part
        )
    if part != FROZEN:
        return islice(world_pairs(data, part, kept), count)
    store = load_asset_store(data, "test", commercial_only=False)
    return kept_pairs(read_recipes(LIST)[:count], store, kept and kept / FROZEN)


class _Spheres:
    """The linear limit of any pair; one regression for each kind and bin, learned when it is first asked for."""

    def __init__(self, data: Path, part: str) -> None:
        """part: whose pairs are scored; what is left out are the maps whose licence keeps them from training."""
        store = load_asset_store(data, "train", commercial_only=part == "left-out", with_shapes=False)
        self._views = Views([one.radiance for one in store.maps.values() if not one.lifted])
        self._learned: dict = {}

    def __call__(self, pair) -> dict:
        """LDR maps by the names of SPHERES."""
        number, metal, world = alpha_bin(pair), not pair.material.albedo.any(), is_world(pair)
        alpha = (ALPHA_EDGES[number] + min(ALPHA_EDGES[number + 1], 1.0)) / 2
        draw = (world_draw if world else paper_draw)(metal)
        result = {}
        for name, given in SPHERES.items():
            key = number, metal, world, given
            if key not in self._learned:
                self._learned[key] = SphereLimit(self._views, alpha, draw, world, given)
            result[name] = self._learned[key](pair)
        return result


def show(table: dict[str, dict[str, dict]]) -> None:
    """Print the groups, then total power and explained variance."""
    console = Console(highlight=False, width=WIDTH)
    rows = list(table["all"])
    sheet = Table("LDR RMSE (after the best gain)", "pairs", *rows)
    for group, scores in table.items():
        cells = [
            f"{one['rmse']:.3f}" + (f" ({one['gain_rmse']:.3f})" if "gain_rmse" in one else "")
            for one in scores.values()
        ]
        sheet.add_row(group, str(scores[rows[0]]["pairs"]), *cells)
    console.print(sheet)
    full = [row for row in rows if "explained" in table["all"][row]]
    sheet = Table("total power, stops: median, mean absolute", *full)
    for group, scores in table.items():
        cells = [f"{scores[row]['power_median']:+.2f} {scores[row]['power_mae']:.2f}" for row in full]
        sheet.add_row(group, *cells)
    console.print(sheet)
    for name, of in (("explained", "ln radiance"), ("explained_ldr", "display values")):
        sheet = Table(f"explained variance of {of}, order", *map(str, range(9)), "LDR SSIM")
        for row in full[1:]:
            one = table["all"][row]
            sheet.add_row(row, *(f"{value:.2f}" for value in one[name]), f"{one['ssim']:.3f}")
        console.print(sheet)


if __name__ == "__main__":
    run_command(limits)
