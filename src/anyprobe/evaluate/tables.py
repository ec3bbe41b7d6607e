"""From a study to the result files: which figures stand in which, and what each says of itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from anyprobe.dataset.pair import LN_RANGE
from anyprobe.evaluate.groups import GROUPS, ONE_LIGHT, SHINY
from anyprobe.evaluate.study import CLUSTERED, Study

TABLE1 = tuple(f"{kind}_{name}" for kind in ("irradiance", "ldr", "hdr") for name in ("psnr", "rmse", "ssim"))
FIG13 = ("ball_psnr", "ball_ssim", "ball_rmse")
FIG14 = ("relight_rmse",)
FIELD = tuple(
    f"field_{ball}_{name}"
    for ball in ("diffuse", "silver", "mirror")
    for name in ("rmse", "si_rmse", "angle_deg", "n_rmse")
)
CLEAN = tuple(
    f"clean_{ball}_{name}"
    for ball in ("diffuse", "silver", "mirror")
    for name in ("rmse", "si_rmse", "angle_deg")
)
ARRAY = tuple(f"array_{name}_median" for name in ("rmse", "si_rmse", "angle_deg", "psnr"))
LIGHTS = (
    "peak_deg",
    "peak_deg_median",
    "main_light_deg",
    "main_light_deg_median",
    "lights_deg",
    "lights_published_deg",
    "lights_deg_pairs",
    "lights_published_deg_pairs",
    "sh9_irradiance",
    "flux_stops",
    "flux_r_stops",
    "flux_g_stops",
    "flux_b_stops",
)
SPLITS = (
    "irradiance_ssim",
    "irradiance_rmse",
    "irradiance_rmse_object",
    "ldr_rmse",
    "ldr_ssim",
    "ldr_rmse_seen",
    "ldr_rmse_unseen",
    "hdr_rmse",
    "clean_diffuse_angle_deg",
    "clean_silver_angle_deg",
    "clean_mirror_angle_deg",
    "main_light_deg",
    "main_light_deg_median",
    "flux_stops_median",
)
ORDER = ("direct", "irradiance", "ours", "ideal")
"""The paper's, from worst to best."""
RIVALS = ("georgoulis", "meka", "mean map", "chrome ball")
"""And trivial baselines."""
BESIDE_RIVALS = ("ours", "paper", "lift")

NOTES = {
    "table1": "Mean over pairs. irradiance: 128 x 128 display values, whole picture. ldr: 64 x 128 display values, "
    f"every pixel alike. hdr: PSNR and RMSE of ln radiance with {LN_RANGE[0]:g} to {LN_RANGE[1]:g} brought to 0 to 1; "
    "SSIM of (L / (1 + L))^(1 / 2.2).",
    "fig13": "LDR maps as 64 x 64 mirror balls: PSNR and RMSE inside the ball, SSIM of the picture.",
    "fig14": "RMSE of the display values of a vase of grey plastic (albedo 0.5, f0 0.05, alpha 0.2) lit by the "
    "estimate and by the truth. Methods without an HDR map light it with their LDR map, linear again by the inverse "
    "curve.",
    "field": "Three balls by the field's published arithmetic (field_...), in linear radiance (clean_..., in units of "
    "the true ball's mean), and nine spheres on a plane (median over pairs). Methods without an HDR "
    "map light them with their LDR map, linear again by the inverse curve. Mirror balls: 282 pixels wide, others 32.",
    "lights": "Angles in degrees. peak: after a mean over 5 degrees; lights: matched as EnvMapNet does, with luminance "
    "put right and as published, over those pairs alone whose maps both have lights that can be counted (how many is "
    "given; rows do not compare); sh9_irradiance: relative RMS; flux in stops.",
    "splits": "Means over groups of pairs, median where a name says so; seen is the half of the map behind the camera; "
    f"one light: the main light sends {ONE_LIGHT:.0%} of all light or more; shiny: alpha below {SHINY:g}.",
}


def rows(study: Study, names: Iterable[str], group: str = "all") -> list[dict[str, Any]]:
    """One row a method: "design" and the figures it has."""
    names = tuple(names)
    result = []
    for method in study.rows:
        means = study.means(method, group)
        result.append({"design": method, **{name: means[name] for name in names if name in means}})
    return result


def result_files(study: Study, about: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Name without .json -> content; each carries `about` (command, commit, seed, pairs trained ...)."""
    head = about | {
        "pairs": study.count("all"),
        "maps": len(set(study.maps)),
        "shapes": len(set(study.shapes)),
    }
    files: dict[str, dict[str, Any]] = {
        "table1": {"rows": rows(study, TABLE1), "order": order(study), "standard_errors": CLUSTERED},
        "fig13": {"groups": beside_rivals(study, by_group(study, FIG13, ("specular", "diffuse")), FIG13)},
        "fig14": {
            "groups": beside_rivals(study, by_group(study, FIG14, ("all", "specular", "diffuse")), FIG14)
        },
        "field": {"rows": rows(study, (*FIELD, *CLEAN, *ARRAY))},
        "lights": {"rows": rows(study, LIGHTS)},
        "splits": {"groups": by_group(study, SPLITS, GROUPS)},
    }
    return {name: head | {"note": NOTES[name]} | content for name, content in files.items()}


def by_group(study: Study, names: Iterable[str], groups: Iterable[str]) -> dict[str, Any]:
    """Group -> {"pairs": count, "rows": rows}; groups without a pair are left out."""
    names = tuple(names)
    return {
        group: {"pairs": study.count(group), "rows": rows(study, names, group)}
        for group in groups
        if study.count(group)
    }


def beside_rivals(study: Study, groups: dict[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """The groups of by_group, each with "ahead": method -> rival -> figure -> how much more the method has of it."""
    names = tuple(names)
    for group, one in groups.items():
        one["ahead"] = {
            method: {
                rival: {
                    name: study.difference(method, rival, name, group)
                    for name in names
                    if all(name in study.rows[each][0] for each in (method, rival))
                }
                for rival in RIVALS
                if rival in study.rows
            }
            for method in BESIDE_RIVALS
            if method in study.rows
        }
    return groups


def order(study: Study) -> dict[str, Any]:
    """Each step of the paper's order, pair by pair: how much better, and whether that is more than chance."""
    steps: dict[str, Any] = {}
    present = [name for name in ORDER if name in study.rows]
    steps_of = list(zip(present[:-1], present[1:], strict=True))
    if "ours_2" in study.rows and "irradiance_2" in study.rows:
        steps_of.append(("irradiance_2", "ours_2"))
    for worse, better in steps_of:
        steps[f"{worse} < {better}"] = {
            name: study.difference(better, worse, name)
            for name in ("ldr_ssim", "ldr_rmse", "ldr_psnr", "hdr_psnr", "hdr_rmse", "hdr_ssim")
        }
    return steps
