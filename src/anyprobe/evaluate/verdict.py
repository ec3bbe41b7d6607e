"""What a study says of the paper's claims, in sentences made from its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from anyprobe.evaluate.irradiance_limits import PHOTO, STAGES, SURFACES
from anyprobe.evaluate.paper_rows import TABLE1
from anyprobe.evaluate.tolerance import DESIGNS as TOLERANT
from anyprobe.evaluate.tolerance import tolerated

LOWER_IS_BETTER = ("ldr_rmse", "hdr_rmse", "ball_rmse", "relight_rmse")
SURE = 2.0
"""Standard errors from zero."""
SHAKEN = {
    "irradiance": "irradiance, sharp targets",
    "ours": "ours, against its own target",
    "ours_sharp": "ours, against the sharp map",
    "irradiance_2": "irradiance, sharp targets, second seed",
    "ours_2": "ours, against its own target, second seed",
    "ours_2_sharp": "ours, against the sharp map, second seed",
}
CURVES = ("direct", "irradiance", "ours_sharp", "irradiance_2", "ours_2_sharp")
"""Columns of a run's log that compare: each error is against the map itself."""


def step_holds(name: str, difference: Mapping[str, float | None]) -> str:
    """ "holds", "is reversed" or "is open": whether a step's mean gain is more than two standard errors."""
    gain = -difference["mean"] if name in LOWER_IS_BETTER else difference["mean"]
    error = difference["standard_error"]
    if error is None or abs(gain) <= SURE * error:
        return "is open"
    return "holds" if gain > 0 else "is reversed"


def order_lines(table1: Mapping[str, Any]) -> Iterable[str]:
    """Each step of Direct < Irradiance < Ours < Ideal, figure by figure."""
    if not table1.get("order"):
        return
    yield from ("", "### Does the paper's order hold?", "")
    yield "The gain of the second design over the first, pair by pair: positive is better in every column (RMSE with"
    yield "its sign turned). A step *holds* where the gain is more than two standard errors above zero, *is"
    by = table1.get("standard_errors", "by map")
    yield f"reversed* where it is more than two below, and *is open* else. Standard errors are {by}, whose"
    yield "pairs may err together; what another training would give, they do not cover: where both seeds agree, it is"
    yield "a little surer."
    yield ""
    names = list(next(iter(table1["order"].values())))
    yield from order_table(table1["order"])
    yield ""
    for step, figures in table1["order"].items():
        verdicts = {name: step_holds(name, figures[name]) for name in names}
        parts = [f"holds in {list(verdicts.values()).count('holds')} of {len(names)} figures"]
        for verdict in ("is open", "is reversed"):
            named = [name.replace("_", " ") for name in names if verdicts[name] == verdict]
            if named:
                parts.append(f"{verdict} in {', '.join(named)}")
        yield f"- {step}: {'; '.join(parts)}."
    verdicts = [
        step_holds(name, one) for figures in table1["order"].values() for name, one in figures.items()
    ]
    yield ""
    if set(verdicts) == {"holds"}:
        yield "Every step of the paper's order holds in every figure."
    else:
        yield f"**Here we fall short of the paper's order:** {len(verdicts) - verdicts.count('holds')} of"
        yield f"{len(verdicts)} comparisons are open or reversed."


def order_table(order: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Iterable[str]:
    """Each step's gain in each figure, and what follows."""
    names = list(next(iter(order.values())))
    yield "| step | " + " | ".join(name.replace("_", " ") for name in names) + " |"
    yield "|" + "---|" * (len(names) + 1)
    for step, figures in order.items():
        cells = [gain_cell(name, figures[name]) for name in names]
        yield f"| {step} | " + " | ".join(cells) + " |"


def gain_cell(name: str, one: Mapping[str, float | None]) -> str:
    """A step's gain in a figure, positive where the second is better, its standard error, and what follows."""
    gain = -one["mean"] if name in LOWER_IS_BETTER else one["mean"]
    error = "?" if one["standard_error"] is None else f"{one['standard_error']:.5f}"
    return f"{gain:+.5f} +- {error}, {step_holds(name, one)}"


def limit_lines(table1: Mapping[str, Any]) -> Iterable[str]:
    """What each step of the chain costs: the figures with truth in the place of one network's estimate."""
    rows = {row["design"]: row for row in table1["rows"]}
    if not {"ours", "ideal"} <= set(rows):
        return
    ours, ideal = rows["ours"], rows["ideal"]

    def change(name: str, better: Mapping[str, float] = ideal) -> str:
        return f"{name.replace('_', ' ')} {ours[name]:.4f} to {better[name]:.4f}"

    yield from ("", "### What limits it", "")
    if "mean map" in rows:
        blank = rows["mean map"]
        yield "- What has been learned so far: the mean map, which looks at no photo, has"
        yield f"  ldr ssim {blank['ldr_ssim']:.4f} and ldr rmse {blank['ldr_rmse']:.4f};"
        yield f"  ours {ours['ldr_ssim']:.4f} and {ours['ldr_rmse']:.4f}."
    yield f"- Irradiance network: SSIM {ours['irradiance_ssim']:.4f}, RMSE {ours['irradiance_rmse']:.4f}, whole"
    yield "  picture; the paper has 0.9502 and 0.0449. True irradiance in its place takes"
    yield f"  {change('ldr_ssim')}, {change('ldr_rmse')}."
    yield "- Illumination network: the true LDR map in its place takes"
    yield f"  {change('hdr_ssim')}, {change('hdr_rmse')}."
    if "paper" in rows and "last_run_pairs" in table1.get("paper", {}):
        yield "- Size and other pairs: the shipped chain `paper`, wider and of larger pictures and maps, after"
        yield f"  {table1['paper']['last_run_pairs']:,} older pairs, takes {change('ldr_ssim', rows['paper'])},"
        yield f"  {change('ldr_rmse', rows['paper'])}."


LIT = {
    "relit object, RMSE": ("fig14", "relight_rmse"),
    "irradiance, SH9": ("lights", "sh9_irradiance"),
    "flux, stops": ("lights", "flux_stops"),
    "main light, degrees": ("lights", "main_light_deg"),
}
"""What an HDR map is for: the result file and the figure."""


def hdr_lines(found: Mapping[str, Any]) -> Iterable[str]:
    """What the HDR network loses by itself: ideal, which gives it the true LDR map, beside light from photos."""
    if not {"fig14", "lights"} <= set(found):
        return
    rows = {
        "fig14": {row["design"]: row for row in found["fig14"]["groups"]["all"]["rows"]},
        "lights": {row["design"]: row for row in found["lights"]["rows"]},
    }
    methods = [name for name in ("ideal", "ours", "paper", "lift") if name in rows["lights"]]
    if "ideal" not in methods:
        return
    yield "- HDR network: ideal gives it the *true* LDR map; what its light still loses, beside light from photos:"
    yield ""
    yield "| light of | " + " | ".join(LIT) + " |"
    yield "|" + "---|" * (len(LIT) + 1)
    for name in methods:
        yield f"| {name} | " + " | ".join(f"{rows[file][name][key]:.3f}" for file, key in LIT.values()) + " |"
    lost = {
        name: [
            title for title, (file, key) in LIT.items() if rows[file][name][key] < rows[file]["ideal"][key]
        ]
        for name in methods[1:]
    }
    yield ""
    for name, figures in lost.items():
        if figures:
            yield f"  {name}, which sees the photo alone, is nearer than ideal in: {'; '.join(figures)}."


def tolerance_lines(tolerance: Mapping[str, Any]) -> Iterable[str]:
    """How true the irradiance image must be before the paper's order holds."""
    direct = tolerance["direct"]
    yield from ("", "### How true the irradiance image must be: an experiment", "")
    yield "The estimated image is replaced by (1 - s) x estimate + s x truth, without training again, to see from"
    yield "which error on Irradiance and Ours are ahead of Direct in the mean. The paper's network, whose errors are"
    yield f"no mixtures with the truth, has an RMSE of {TABLE1['irradiance']['irradiance_rmse']:.3f}, so that this is"
    yield "a guide only."
    yield from ("", tolerance["note"], "")
    yield "| share of truth | irradiance RMSE | SSIM | irradiance: ldr RMSE | SSIM | ours: ldr RMSE | SSIM |"
    yield "|---|---|---|---|---|---|---|"
    for row in tolerance["rows"]:
        cells = [f"{row['irradiance_rmse']:.4f}", f"{row['irradiance_ssim']:.4f}"]
        for name in TOLERANT:
            cells += [f"{row[f'{name}_ldr_rmse']:.4f}", f"{row[f'{name}_ldr_ssim']:.4f}"]
        yield f"| {row['share']:.0%} | " + " | ".join(cells) + " |"
    yield ""
    yield f"Direct, which sees the photo: ldr RMSE {direct['ldr_rmse']:.4f}, SSIM {direct['ldr_ssim']:.4f}."
    yield ""
    yield from level_lines(tolerance)


def level_lines(tolerance: Mapping[str, Any]) -> Iterable[str]:
    """From which irradiance RMSE on each design is ahead of direct."""
    for name in TOLERANT:
        for figure in ("ldr_rmse", "ldr_ssim"):
            level = tolerated(tolerance, name, figure)
            title = figure.replace("ldr_", "").upper()
            if level is None:
                yield f"- {name}, {title}: behind direct even with true irradiance."
            elif level == tolerance["rows"][0]["irradiance_rmse"]:
                yield f"- {name}, {title}: on the mean ahead of direct as it is, irradiance RMSE {level:.2f}."
            else:
                yield f"- {name}, {title}: level with direct at an irradiance RMSE of about {level:.2f}."


def irradiance_lines(limits: Mapping[str, Any]) -> Iterable[str]:
    """What of the irradiance image's error is a gain, and on which surfaces it is as good as the paper's."""
    groups, paper = limits["groups"], TABLE1["irradiance"]["irradiance_ssim"]
    yield from ("", "### What limits the irradiance image: an experiment", "", limits["note"])
    yield f"Bold: at or above the paper's SSIM, {paper:.4f}."
    yield ""
    heads = ("surface", "pairs", "method", "RMSE", "SSIM", "gain: RMSE", "SSIM", "explained")
    heads += ("channel: RMSE", "SSIM", "explained")
    yield "| " + " | ".join(heads) + " |"
    yield "|" + "---|" * len(heads)
    for group, one in groups.items():
        for row in one["rows"]:
            cells = [group, str(one["pairs"]), row["design"]]
            for stage in STAGES:
                ssim = f"{row[f'{stage}ssim']:.4f}"
                cells += [f"{row[f'{stage}rmse']:.4f}", f"**{ssim}**" if _meets(row, stage) else ssim]
                cells += [f"{row[f'{stage}explained']:.0%}"] if stage else []
            yield "| " + " | ".join(cells) + " |"
    yield ""
    of = {group: {row["design"]: row for row in one["rows"]} for group, one in groups.items()}
    for method in of["all"]:
        if method != PHOTO:
            yield from limits_of(method, {group: rows[method] for group, rows in of.items()})
            yield from _beside_photo(method, of["all"])


def limits_of(method: str, rows: Mapping[str, Mapping[str, float]]) -> Iterable[str]:
    """What an irradiance image's error is made of; rows: of one method, by group."""
    whole, paper = rows["all"], TABLE1["irradiance"]
    yield f"- {method}: each image times its own best gain (chosen with the truth; {whole['gain_stops']:.2f} stops up"
    yield f"  or down in the mean) has {whole['gain_explained']:.0%} less squared error, with a gain for each channel"
    yield f"  {whole['channel_explained']:.0%} less; what remains is shape. With the one gain RMSE goes from"
    yield f"  {whole['rmse']:.4f} to {whole['gain_rmse']:.4f} and SSIM from {whole['ssim']:.4f} to"
    yield f"  {whole['gain_ssim']:.4f} (the paper's: {paper['irradiance_rmse']:.4f}, {paper['irradiance_ssim']:.4f})."
    surfaces = [name for bins in SURFACES.values() for name in bins if name in rows]
    for when, stage in (("As it is", ""), ("After the one gain", "gain_")):
        met = [name for name in surfaces if _meets(rows[name], stage)]
        yield f"  {when} it meets the paper's SSIM {_where(surfaces, met)}."
    worst = min(surfaces, key=lambda name: rows[name]["gain_ssim"])
    yield f"  The lowest SSIM after the gain, {rows[worst]['gain_ssim']:.4f}, is that of {worst}"
    if worst == SURFACES["dielectric"][0]:
        yield "  (the irradiance image of a smooth surface is close to a mirror image, of which a dielectric shows"
        yield "  some 4 % beside its diffuse light)."
    else:
        yield f"  (of {SURFACES['dielectric'][0]}: {_shown(rows, SURFACES['dielectric'][0])})."


def _beside_photo(method: str, rows: Mapping[str, Mapping[str, float]]) -> Iterable[str]:
    """Whether a method gives more than the photo that it is given."""
    photo, one = rows[PHOTO], rows[method]
    better = {
        "RMSE": one["rmse"] < photo["rmse"],
        "SSIM": one["ssim"] > photo["ssim"],
        "RMSE after the gain": one["gain_rmse"] < photo["gain_rmse"],
        "SSIM after the gain": one["gain_ssim"] > photo["gain_ssim"],
    }
    won, lost = ([name for name in better if better[name] is answer] for answer in (True, False))
    yield f"  Over all pairs it is better than the photo itself in {', '.join(won) or 'no figure'}"
    yield f"  and not in {', '.join(lost)}." if lost else "  and so in every figure."


def _where(surfaces: Sequence[str], met: Sequence[str]) -> str:
    if len(met) in (0, len(surfaces)):
        return f"on {'each' if met else 'none'} of the {len(surfaces)} surfaces"
    return f"on {'; '.join(met)}, not on {'; '.join(name for name in surfaces if name not in met)}"


def _meets(row: Mapping[str, float], stage: str) -> bool:
    return row[f"{stage}ssim"] >= TABLE1["irradiance"]["irradiance_ssim"]


def _shown(rows: Mapping[str, Mapping[str, float]], group: str) -> str:
    return f"{rows[group]['gain_ssim']:.4f}" if group in rows else "no pairs"


def curve_lines(gradual: Mapping[str, Any]) -> Iterable[str]:
    """What the curves say of gradual targets and of more pairs: means over a tenth of the run."""
    columns = gradual["columns"]
    span = max(1, len(columns["pairs"]) // 10)
    half = len(columns["pairs"]) // 2

    def at(name: str, end: int) -> float:
        return sum(columns[name][max(0, end - span) : end]) / min(span, end)

    yield ""
    middle_pairs, last_pairs = columns["pairs"][half - 1], columns["pairs"][-1]
    yield "Error against the sharp map, means over a tenth of the run that ends at"
    yield f"{middle_pairs:,.0f} and at {last_pairs:,.0f} pairs (the learning rate falls to zero in between):"
    yield ""
    for name in CURVES:
        if name in columns:
            middle, last = at(name, half), at(name, len(columns["pairs"]))
            fall = 100 * (1 - last / middle)
            title = name.removesuffix("_sharp").replace("_2", ", second seed")
            yield f"- {title}: {middle:.4f} to {last:.4f} ({fall:.1f} % less)"
    yield from vibration_lines(columns)


def vibration_lines(columns: Mapping[str, Sequence[float]]) -> Iterable[str]:
    """Whether the loss shakes less with targets that sharpen, which is the paper's reason for them (its Fig. 6)."""
    shaken = [name for name in SHAKEN if name in columns]
    first, last = len(columns["pairs"]) // 20, len(columns["pairs"]) // 2
    if last - first < 3 or not shaken:
        return
    step = columns["pairs"][1] - columns["pairs"][0]
    yield ""
    yield "The paper's reason for targets that sharpen is that the loss vibrates less. How much it changes from a mean"
    yield f"of {step:,.0f} pairs to the next (root mean square over sqrt 2), from {columns['pairs'][first]:,.0f} to"
    yield f"{columns['pairs'][last - 1]:,.0f} pairs, where the learning rate is constant:"
    yield ""
    for name in shaken:
        values = columns[name][first:last]
        changes = [(b - a) ** 2 for a, b in zip(values, values[1:], strict=False)]
        shake, mean = (sum(changes) / len(changes) / 2) ** 0.5, sum(values) / len(values)
        title = SHAKEN[name]
        yield f"- {title}: {shake:.5f}, {shake / mean:.1%} of the loss"


def rival_lines(found: Mapping[str, Any], figures: Sequence[str]) -> Iterable[str]:
    """Of each method that is set beside rivals and baselines, group by group and figure by figure: better, level or
    behind, by two standard errors pair by pair."""
    yield ""
    for group, one in found["groups"].items():
        for method, rivals in one.get("ahead", {}).items():
            for name in figures:
                if all(name in differences for differences in rivals.values()) and rivals:
                    verdicts = {
                        rival: step_holds(name, differences[name]) for rival, differences in rivals.items()
                    }
                    yield f"- {group}, {name.split('_')[-1].upper()}: {method} {_beside(verdicts)}."


def _beside(verdicts: Mapping[str, str]) -> str:
    """Of rival -> step_holds, in words."""
    words = {"holds": "is better than", "is open": "is level with", "is reversed": "is behind"}
    if set(verdicts.values()) == {"holds"}:
        return "is better than every rival and baseline"
    parts = []
    for verdict, word in words.items():
        named = [rival for rival, one in verdicts.items() if one == verdict]
        if named:
            parts.append(f"{word} {', '.join(named)}")
    return "; ".join(parts)
