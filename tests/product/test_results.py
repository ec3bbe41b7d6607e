"""From a study to result files to the page: means, orders and sentences that follow from the numbers."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.some_pair import ball_pair

from anyprobe.cli.compare import until
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.evaluate.figures import Figures
from anyprobe.evaluate.kept_pairs import read_pair, write_pair
from anyprobe.evaluate.methods import baselines
from anyprobe.evaluate.panel import Estimate
from anyprobe.evaluate.report import smooth, write_report
from anyprobe.evaluate.sheets import draw_chart, heat
from anyprobe.evaluate.study import Study, clustered_error, one_way_variance, study
from anyprobe.evaluate.tables import beside_rivals, by_group, result_files
from anyprobe.evaluate.tolerance import Tolerance, tolerated
from anyprobe.evaluate.trials import trial_lines
from anyprobe.evaluate.verdict import gain_cell, order_lines, rival_lines, step_holds, tolerance_lines

ABOUT = {"command": "anyprobe compare", "commit": "abc", "recipes": "0123"}


def invented(**ssim):
    """A study of two specular and two diffuse pairs in which only ldr_ssim was measured."""
    result = Study()
    for index, material in enumerate((0, 0, 1, 1)):
        pair = ball_pair(index, alpha=0.2 if material == 0 else 0.8, material=material)
        result.add(pair, {name: {"ldr_ssim": values[index]} for name, values in ssim.items()})
    return result


def test_means_go_by_group():
    result = invented(ours=(0.1, 0.3, 0.5, 0.9))
    assert result.means("ours")["ldr_ssim"] == pytest.approx(0.45)
    assert result.means("ours", "specular")["ldr_ssim"] == pytest.approx(0.2)
    assert result.means("ours", "alpha 0.75-1")["ldr_ssim"] == pytest.approx(0.7)
    assert result.count("diffuse") == 2


def test_difference_is_paired():
    result = invented(ours=(0.2, 0.4, 0.6, 1.0), direct=(0.1, 0.3, 0.5, 0.9))
    one = result.difference("ours", "direct", "ldr_ssim")
    assert one == {"mean": pytest.approx(0.1), "standard_error": pytest.approx(0.0)}
    d = np.array([0.1, 0.1, 0.1, 0.5])
    shifted = invented(ours=(0.2, 0.4, 0.6, 1.4), direct=(0.1, 0.3, 0.5, 0.9))
    error = shifted.difference("ours", "direct", "ldr_ssim")["standard_error"]
    assert error == pytest.approx(d.std(ddof=1) / 2, abs=1e-5)
    shifted.maps = ["a", "b"] * 2  # whose pairs may err together: by -.2 and by .2 from the mean
    error = shifted.difference("ours", "direct", "ldr_ssim")["standard_error"]
    assert error == pytest.approx(np.sqrt(2 * (0.2**2 + 0.2**2)) / 4, abs=1e-5)
    shifted.maps = ["a"] * 4
    assert shifted.difference("ours", "direct", "ldr_ssim")["standard_error"] is None
    shifted.shapes = ["a", "b"] * 2  # and so may those of one shape
    assert shifted.difference("ours", "direct", "ldr_ssim")["standard_error"] == error


def crossed(by_map, by_shape):
    """One pair of every map and shape: what each adds to d, and the names."""
    d = np.add.outer(by_map, by_shape)
    maps, shapes = np.meshgrid(range(len(by_map)), range(len(by_shape)), indexing="ij")
    return d.ravel(), [f"map {k}" for k in maps.ravel()], [f"shape {k}" for k in shapes.ravel()]


def test_pairs_of_one_map_that_are_all_equal_count_as_one(rng):
    """The error is then that of the maps' means; and of the shapes', where these decide alone."""
    means = rng.normal(size=7)
    error = means.std(ddof=1) / np.sqrt(7)
    d, maps, shapes = crossed(means, np.zeros(4))
    assert clustered_error(d, maps, shapes) == pytest.approx(error)
    assert clustered_error(d, shapes, maps) == pytest.approx(error)
    assert clustered_error(means, list("abcdefg"), ["one"] * 7) == pytest.approx(error)
    assert clustered_error(means, list("abcdefg"), list("tuvwxyz")) == pytest.approx(error)
    assert clustered_error([1.0, 1.0], ["a", "b"], ["a", "b"]) == 0.0


def test_pairs_of_one_map_and_shape_tell_of_no_error():
    """Two alike would else be certain."""
    assert np.isnan(clustered_error([0.0010, 0.0012], ["a", "a"], ["s", "s"]))
    alone = invented(ours=(0.2, 0.4, 0.6, 1.0), direct=(0.1, 0.3, 0.5, 0.9))
    alone.maps, alone.shapes = ["a"] * 4, ["s"] * 4
    gain = alone.difference("ours", "direct", "ldr_ssim")
    assert gain["standard_error"] is None
    assert step_holds("ldr_ssim", gain) == "is open"
    assert gain_cell("ldr_ssim", gain) == "+0.10000 +- ?, is open"


def test_maps_and_shapes_add_up(rng):
    """d = a + b, each map with each shape once: var(a) / G + var(b) / H, less what both would have counted twice."""
    a, b = rng.normal(size=6), rng.normal(size=5)
    expected = a.var(ddof=1) / 6 + b.var(ddof=1) / 5 - (a.var() + b.var()) / 29
    assert clustered_error(*crossed(a, b)) == pytest.approx(np.sqrt(expected))
    assert clustered_error(*crossed(a, b)) > clustered_error(*crossed(a, 0 * b))


def test_an_error_is_never_below_that_of_maps_or_of_shapes(rng):
    d = rng.normal(size=40)
    maps, shapes = [f"{k % 8}" for k in range(40)], [f"{k // 8}" for k in range(40)]
    one_way = [one_way_variance(d, names) for names in (maps, shapes)]
    assert sum(one_way) - one_way_variance(d, list(zip(maps, shapes, strict=True))) < max(one_way)
    assert clustered_error(d, maps, shapes) == pytest.approx(np.sqrt(max(one_way)))


def test_a_step_holds_only_beyond_two_standard_errors():
    assert step_holds("ldr_ssim", {"mean": 0.03, "standard_error": 0.01}) == "holds"
    assert step_holds("ldr_ssim", {"mean": 0.015, "standard_error": 0.01}) == "is open"
    assert step_holds("ldr_ssim", {"mean": -0.03, "standard_error": 0.01}) == "is reversed"
    assert step_holds("ldr_rmse", {"mean": -0.03, "standard_error": 0.01}) == "holds"


def test_sentences_count_what_holds():
    up, down = {"mean": 0.1, "standard_error": 0.01}, {"mean": -0.1, "standard_error": 0.01}
    text = "\n".join(order_lines({"order": {"a < b": {"ldr_ssim": up, "ldr_rmse": up}}}))
    assert "- a < b: holds in 1 of 2 figures; is reversed in ldr rmse." in text
    assert "1 of\n2 comparisons are open or reversed" in text
    text = "\n".join(order_lines({"order": {"a < b": {"ldr_ssim": up, "ldr_rmse": down}}}))
    assert "Every step of the paper's order holds" in text


def test_rivals_are_told_apart_by_two_standard_errors():
    def ahead(**gains):
        differences = {
            rival: {"ball_rmse": {"mean": mean, "standard_error": 0.01}} for rival, mean in gains.items()
        }
        return {"groups": {"diffuse": {"pairs": 4, "ahead": {"ours": differences}}}}

    (_, line) = rival_lines(ahead(meka=-0.03, georgoulis=0.015), ("ball_rmse",))
    assert line == "- diffuse, RMSE: ours is better than meka; is level with georgoulis."
    (_, line) = rival_lines(ahead(meka=-0.03, georgoulis=-0.025), ("ball_rmse",))
    assert line == "- diffuse, RMSE: ours is better than every rival and baseline."
    (_, line) = rival_lines(ahead(meka=0.03), ("ball_rmse",))
    assert line == "- diffuse, RMSE: ours is behind meka."


def test_rivals_are_compared_group_by_group():
    result = invented(ours=(0.1, 0.3, 0.5, 0.9), meka=(0.2, 0.4, 0.1, 0.5))
    groups = beside_rivals(result, by_group(result, ("ldr_ssim",), ("specular", "diffuse")), ("ldr_ssim",))
    means = {name: one["ahead"]["ours"]["meka"]["ldr_ssim"]["mean"] for name, one in groups.items()}
    assert means == {"specular": pytest.approx(-0.1), "diffuse": pytest.approx(0.4)}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Result files and pictures of a real study of two pairs, with invented designs."""
    folder = tmp_path_factory.mktemp("results")

    def design(amount):
        def method(pair):
            rng = np.random.default_rng(0)
            radiance = pair.radiance * np.exp(rng.normal(scale=amount, size=pair.radiance.shape))
            radiance = radiance.astype(np.float32)
            return Estimate(ldr=response(radiance), radiance=radiance, irradiance=pair.irradiance / 256.0)

        return method

    methods = baselines() | {"direct": design(1.0), "irradiance": design(0.7), "ours": design(0.9)}
    methods |= {"ideal": design(0.1), "meka": lambda pair: Estimate(ldr=0.999 * response(pair.radiance))}
    pairs = [ball_pair(seed) for seed in (0, 2)]
    pairs += [ball_pair(seed, alpha=0.8, indoor=False, material=1) for seed in (1, 3)]
    figures = Figures(2)
    result = study(pairs, methods, figures.add)
    trained = {"designs": {"steps": 5, "of_steps": 9, "pairs": 80, "seed": 3, "irradiance_pairs": 320000}}
    for name, content in result_files(result, ABOUT | trained | {"remark": "Stopped early."}).items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    curve = [0.5 - 0.01 * k for k in range(30)]
    columns = {name: curve for name in ("direct", "irradiance", "ours", "ours_sharp")}
    columns["pairs"] = [16 * (k + 1) for k in range(30)]
    (folder / "gradual.json").write_text(json.dumps({"columns": columns}))
    figures.save(folder)
    return folder


def test_table1_has_the_rows_and_names_that_readers_look_for(results):
    table = json.loads((results / "table1.json").read_text())
    rows = {row["design"]: row for row in table["rows"]}
    assert {"direct", "irradiance", "ours", "ideal"} <= set(rows)
    for name in ("irradiance_ssim", "ldr_psnr", "ldr_rmse", "ldr_ssim", "hdr_psnr", "hdr_rmse", "hdr_ssim"):
        assert rows["ours"][name] > 0
    assert table["pairs"] == 4
    assert table["command"] == ABOUT["command"]
    assert table["designs"]["pairs"] == 80
    assert table["standard_errors"] == "by map and shape"
    assert "hdr_psnr" not in rows["meka"]
    assert rows["ideal"]["ldr_ssim"] > rows["irradiance"]["ldr_ssim"] > rows["ours"]["ldr_ssim"]


def test_page_names_the_hdr_network_that_was_put_in(results):
    path = results / "table1.json"
    table = json.loads(path.read_text())
    assert "half of the estimated maps it learns from\nare Direct's." in report_of(results)
    table["designs"] |= {"hdr_run": "hdr_curves", "hdr_pairs": 1600}
    path.write_text(json.dumps(table))
    text = report_of(results)
    assert "One HDR network serves all; it is that of hdr_curves, 1,600 views of maps." in text
    assert "are Direct's" not in text


@pytest.mark.parametrize("design", ["mine_normals", "towards the camera"])
def test_what_is_told_is_never_the_best(results, design):
    path = results / "fig13.json"
    balls = json.loads(path.read_text())
    rows = balls["groups"]["specular"]["rows"]
    (ours,) = (row for row in rows if row["design"] == "ours")
    rows.append({**ours, "design": design, "ball_rmse": 0.0001})
    path.write_text(json.dumps(balls))
    text = report_of(results)
    assert "| 0.0001" in text
    assert "**0.0001**" not in text


def report_of(results) -> str:
    return write_report(results, results.parent / "results.md").read_text()


def test_page_says_what_the_files_say_and_where_it_falls_short(results, tmp_path):
    page = write_report(results, results.parent / "results.md")
    text = page.read_text()
    assert "17.88" in text  # the paper's row beside ours
    assert "80 pairs" in text
    assert "Stopped early." in text
    assert "Here we fall short of the paper's order" in text
    steps = [line for line in text.splitlines() if line.startswith("- irradiance < ours:")]
    assert len(steps) == 1
    assert "holds in 6" not in steps[0]
    assert (
        "- ours, against the sharp map: 0.00707, 1.7% of the loss" in text
    )  # steps of .01, over sqrt 2; mean .425
    assert "- direct: 0.3700 to 0.2200 (40.5 % less)" in text  # means of three, ending at 15 and at 30
    balls = text.split("## Balls")[1].split("\n## ")[0]
    assert re.search(r"- specular, RMSE: ours .*is behind meka", balls)  # it was given the truth
    assert "- all, RMSE: ours is" in text.split("## Relighting")[1].split("\n## ")[0]
    table = text.split("HDR network: ideal")[1]
    assert [line.split(" |")[0] for line in table.splitlines()[4:6]] == ["| ideal", "| ours"]
    assert "nearer than ideal" not in table
    assert "**-**" not in text
    assert "of 4 maps\nand 1 shapes" in text
    assert not re.search(r"\bnan\b|\binf\b", text)
    for line in text.splitlines():
        if line.startswith("!["):
            name = line.rsplit("(", 1)[1].rstrip(")")
            if name != "irradiance_kinds.png":
                with Image.open(page.parent / name) as picture:
                    assert picture.width > 100
    assert "Standard errors are by map and shape, whose" in text
    again = text
    assert write_report(results, page).read_text() == again


def test_a_page_anywhere_links_to_its_charts(results, tmp_path, monkeypatch):
    """Beside the results' folder, elsewhere, and with one of the two paths absolute."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(results, tmp_path / "docs" / "results")
    for folder, page in (("docs/results", "out/page.md"), (tmp_path / "docs" / "results", "docs/results.md")):
        text = write_report(Path(folder), Path(page)).read_text()
        links = [line.rsplit("(", 1)[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]
        charts = [link for link in links if link != "irradiance_kinds.png"]
        assert len(charts) >= 4
        for link in charts:
            assert not Path(link).is_absolute()
            assert (Path(page).parent / link).is_file()


def test_a_result_file_that_lacks_something_is_named(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    charts = {path: path.stat().st_mtime_ns for path in folder.glob("*.png")}

    def refused(name, content, match):
        before = (folder / f"{name}.json").read_text()
        (folder / f"{name}.json").write_text(json.dumps(content))
        with pytest.raises(InputError, match=match):
            write_report(folder, tmp_path / "page.md")
        (folder / f"{name}.json").write_text(before)

    table, balls = (json.loads((folder / f"{name}.json").read_text()) for name in ("table1", "fig13"))
    refused("table1", {**table, "designs": {"pairs": 3}}, "table1.json: expected 'steps' in this result file")
    refused(
        "table1", {name: one for name, one in table.items() if name != "note"}, "table1.json: expected 'note'"
    )
    refused("fig13", {**balls, "groups": {"specular": {"pairs": 1}}}, "fig13.json: expected 'rows'")
    refused("fig13", [balls], "fig13.json: expected a result file, got a list")
    (folder / "laboratory").mkdir()
    alone = {**table, "rows": [row for row in table["rows"] if row["design"] != "ours"]}
    (folder / "laboratory" / "table1.json").write_text(json.dumps(alone))
    refused("fig13", balls, "expected result files that belong together, got none with 'ours'")
    assert not (tmp_path / "page.md").exists()
    assert charts == {path: path.stat().st_mtime_ns for path in folder.glob("*.png")}


def test_a_run_of_the_laboratory_gets_its_section(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    assert "One camera and eight materials" not in write_report(folder, tmp_path / "page.md").read_text()
    table = json.loads((folder / "table1.json").read_text())
    for row in table["rows"]:
        if row["design"] == "ours":
            row |= {"irradiance_rmse": 0.0321, "irradiance_ssim": 0.9432}
    (folder / "laboratory").mkdir()
    (folder / "laboratory" / "table1.json").write_text(json.dumps(table))
    text = write_report(folder, tmp_path / "page.md").read_text()
    section = text.split("### One camera and eight materials")[1].split("\n#")[0]
    assert "Given a mixture" not in section
    rows = [
        {"share": share, "irradiance_rmse": error, "irradiance_ssim": 0.9}
        | {f"{name}_{figure}": value for name in ("irradiance", "ours") for figure, value in each.items()}
        for share, error, each in (
            (0.0, 0.05, {"ldr_rmse": 0.20, "ldr_ssim": 0.2}),
            (1.0, 0.0, {"ldr_rmse": 0.10, "ldr_ssim": 0.4}),
        )
    ]
    tolerance = {"note": "", "direct": {"ldr_rmse": 0.25, "ldr_ssim": 0.3}, "rows": rows}
    (folder / "laboratory" / "tolerance.json").write_text(json.dumps(tolerance))
    numbers = dict.fromkeys(("rmse", "ssim", "gain_rmse", "gain_ssim", "gain_stops", "gain_explained"), 0.5)
    row = {"design": "irradiance", "channel_explained": 0.6} | numbers
    groups = {name: {"pairs": 1, "rows": [row]} for name in ("all", "metal, alpha 0.5-1")}
    groups["dielectric, alpha 0-0.1"] = {"pairs": 1, "rows": [row | {"ssim": 0.97}]}
    (folder / "laboratory" / "irradiance.json").write_text(json.dumps({"groups": groups}))
    text = write_report(folder, tmp_path / "page.md").read_text()
    assert "it meets the paper's SSIM on dielectric, alpha 0-0.1, not on metal, alpha 0.5-1." in text
    assert "  - ours, RMSE: on the mean ahead of direct as it is, irradiance RMSE 0.05." in text
    assert "  - ours, SSIM: level with direct at an irradiance RMSE of about 0.03" in text
    assert "RMSE 0.0321, SSIM 0.9432; that of the run above" in section
    assert "in the paper RMSE 0.0449, SSIM 0.9502." in " ".join(section.split())
    assert "- irradiance < ours: holds in 0 of 6 figures" in section  # ours was made worse than irradiance
    assert section.count("\n| ours |") == 1


def test_no_results_is_one_clear_line(tmp_path):
    with pytest.raises(InputError, match="run anyprobe compare"):
        write_report(tmp_path, tmp_path / "page.md")
    (tmp_path / "table1.json").write_text("{")
    with pytest.raises(InputError, match="damaged"):
        write_report(tmp_path, tmp_path / "page.md")


def test_a_kept_pair_comes_back_as_it_was(tmp_path):
    pair = replace(ball_pair(3), tan_half=0.25)
    write_pair(tmp_path / "a.npz", pair)
    back = read_pair(tmp_path / "a.npz")
    assert back.recipe == pair.recipe
    assert (back.tan_half, back.indoor, back.map_name) == (0.25, True, "drawn 3")
    assert back.material.alpha == pair.material.alpha
    for name in ("photo", "irradiance", "radiance", "normals", "gain"):
        np.testing.assert_array_equal(getattr(back, name), getattr(pair, name))


def test_a_comparison_stops_in_time_with_at_least_one_pair():
    assert list(until(iter(range(5)), 0.0)) == [0]
    assert list(until(iter(range(5)), 10.0)) == list(until(iter(range(5)), None)) == [0, 1, 2, 3, 4]


def test_heat_goes_from_black_to_white():
    picture = heat(np.array([[[0.0] * 3, [10.0] * 3, [5.0] * 3]]))
    np.testing.assert_allclose(picture[0], [[0, 0, 0], [1, 1, 1], [0.85, 0, 0.2]], atol=1e-6)


def test_chart_draws_a_line_where_its_values_are():
    chart = np.asarray(draw_chart({"one": ([0, 1], [0, 1])}, "x", "y").convert("RGB")).astype(int)
    blue = (np.abs(chart - [0x1F, 0x77, 0xB4]).sum(-1) < 20).nonzero()
    left, right = blue[0][blue[1] < 100], blue[0][(blue[1] > 540) & (blue[1] < 590)]
    assert left.min() > 250  # low on the left, high on the right
    assert right.min() < 80


def test_smoothing_keeps_the_last_of_x_and_means_of_y():
    x, y = smooth(list(range(40)), [float(k % 2) for k in range(40)])
    assert x[-1] == 39
    assert y[0] == pytest.approx(0.5)


def test_the_tolerated_error_is_where_two_lines_cross():
    """A design whose error is .3 + 2 x irradiance error against a direct of .35: level at .025."""

    def mixed(name, pair, share):
        error = 0.1 * (1 - share)
        offset = 0.3 + 2 * error if name == "ours" else 0.5
        return pair.irradiance / 255.0 + error, response(pair.radiance) + offset

    tolerance = Tolerance(mixed)
    for seed in range(2):
        pair = ball_pair(seed)
        tolerance.add(pair, response(pair.radiance) + 0.35)
    result = tolerance.result()
    assert [row["irradiance_rmse"] for row in result["rows"]] == pytest.approx([0.1, 0.075, 0.05, 0.025, 0])
    assert result["direct"]["ldr_rmse"] == pytest.approx(0.35, abs=1e-4)
    assert tolerated(result, "ours") == pytest.approx(0.025, abs=1e-3)
    assert tolerated(result, "irradiance") is None
    text = "\n".join(tolerance_lines(result))
    assert "- ours, RMSE: level with direct at an irradiance RMSE of about 0.03" in text
    assert "- irradiance, RMSE: behind direct even with true irradiance." in text


def test_the_page_of_ideas_has_the_trials_that_were_scored():
    """The table of docs/ablation.md is what docs/results/trials.json gives."""
    root = Path(__file__).parents[2] / "docs"
    content = json.loads((root / "results" / "trials.json").read_text(encoding="utf-8"))
    assert "\n".join(trial_lines(content)) in (root / "ablation.md").read_text(encoding="utf-8")
