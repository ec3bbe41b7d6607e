"""Scores of whole photos and cut-outs, by group of photos and by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from anyprobe_train.evaluate.standard_errors import rounded
from research.figure_tables import print_figures
from research.world.whole_scores import summary

ALL, CUT_OUTS = "photos", "cut-outs"
"""All families of whole photos together; cut-outs."""
HEADINGS = {
    "ldr_rmse": "LDR RMSE",
    "gain_rmse": "after gain",
    "dominant_deg": "dominant light, median",
    "dominant_deg_harder": "under the harder half",
    "dominant_deg_hardest": "under the hardest third",
    "dominant_color": "its colour, degrees",
    "said_holds": "error_deg holds in",
    "said_ranks": "error_deg, rank correlation",
    "power_abs": "power, stops",
    "power_median": "its bias, median",
    "sky_ground_abs": "log2 sky / ground",
    "sky_ground_median": "its bias, median",
    "sources": "sources",
    "false_sources": "false sources",
    "white": "white sphere",
    "chrome": "chrome sphere",
    "vase": "vase and shadow",
    "hardness_correlation": "hardness, correlation",
    "hardness_below_08": "hardness of soft light",
    "ssim": "SSIM",
}


@dataclass(kw_only=True)
class Judgement:
    """Figures of every row on every photo, by the groups that the photo belongs to, and its map."""

    scores: dict[str, dict[str, list[Mapping[str, float]]]] = field(default_factory=dict)
    maps: dict[str, list[str]] = field(default_factory=dict)

    def add(self, groups: Sequence[str], map_name: str, rows: Mapping[str, Mapping[str, float]]) -> None:
        """Add one photo's figures by row."""
        for group in groups:
            self.maps.setdefault(group, []).append(map_name)
            for name, row in rows.items():
                self.scores.setdefault(group, {}).setdefault(name, []).append(row)

    def table(self) -> dict[str, dict]:
        """Return {"photos", "maps", "rows": {row: figures}} by group; a family that is alone is left to ALL."""
        alone = len(set(self.scores) - {ALL, CUT_OUTS}) < 2
        return {
            group: {
                "photos": len(self.maps[group]),
                "maps": len(set(self.maps[group])),
                "rows": {
                    name: {key: rounded(value, 5) for key, value in summary(rows, self.maps[group]).items()}
                    for name, rows in by_name.items()
                },
            }
            for group, by_name in self.scores.items()
            if not alone or group in (ALL, CUT_OUTS)
        }


def print_groups(groups: Mapping[str, Mapping], part: str) -> None:
    """Print the table of Judgement.table."""
    for group, one in groups.items():
        print_figures(f"{group} of {part}: {one['photos']} under {one['maps']} maps", one["rows"], HEADINGS, down=True)
