"""anyprobe data render, status, verify: stopped in any way, a dataset goes on and ends up the same."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support import drawn_pairs
from support.drawn_pairs import DrawnRenderer
from support.folders import names, snapshot
from support.mesh_files import obj
from support.refused import refused

from anyprobe.cli import data as data_command
from anyprobe.errors import InputError
from anyprobe.learning.dataset import render_job, shards
from anyprobe.learning.dataset.process_pools import run_local
from anyprobe.learning.dataset.samples import Sample, StoreRenderer, decode_part
from anyprobe.maps.radiance import write_hdr

TESTS = Path(__file__).parents[1]
PATIENCE_S = 300  # for a machine that is busy with other things
SMALL = ("--pairs", "23", "--shard-size", "5", "--procedural-maps", "3", "--procedural-shapes", "0")


def here(work, tasks, watch):
    """An engine without processes."""
    for task in tasks:
        work(task, lambda count, task=task: watch(task, count))


def ignore(*_) -> None:
    pass


def begin(folder: Path, resume: bool = False, data: Path | None = None, **given) -> render_job.RenderJob:
    if not resume:
        given = {"pairs": 23, "shard_size": 5, "procedural_maps": 3, "procedural_shapes": 0, **given}
    return render_job.begin(folder, given, data, DrawnRenderer, resume=resume)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory) -> Path:
    """A whole dataset, rendered in this process: what all others are compared with."""
    folder = tmp_path_factory.mktemp("rendered") / "set"
    render_job.render_missing(begin(folder), here, ignore)
    return folder


@pytest.fixture
def whole(rendered, tmp_path) -> Path:
    """A copy of it to damage."""
    return Path(shutil.copytree(rendered, tmp_path / "set"))


@pytest.fixture
def drawn_command(command, monkeypatch):
    monkeypatch.setattr(data_command, "_make", drawn_pairs.make)
    monkeypatch.setenv("PYTHONPATH", str(TESTS))

    def drawn(verb: str, *arguments):
        """By one process, unless told: each takes a second to start."""
        is_alone = verb in ("render", "verify") and "--workers" not in arguments
        return command("data", verb, *arguments, *(("--workers", 1) if is_alone else ()))

    return drawn


@pytest.fixture
def start():
    """start(folder, options, environment) begins the command in a process group of its own."""
    begun: list[subprocess.Popen] = []

    def start(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen:
        running = subprocess.Popen(
            [sys.executable, "-m", "support.drawn_pairs", "data", "render", str(folder), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(TESTS), "COLUMNS": "300", **environment},
            start_new_session=True,
        )
        begun.append(running)
        return running

    yield start
    for running in begun:
        with suppress(ProcessLookupError):
            os.killpg(running.pid, signal.SIGKILL)
        running.communicate()


def wait_for(true, running: subprocess.Popen | None = None) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline
        assert running is None or running.poll() is None, running.stderr.read()
        time.sleep(0.01)


def in_work(folder: Path) -> bool:
    """Two shards done, two half-way: where DRAWN_STOP=12 ends."""
    return {path.name for path in folder.glob("shard-*.json")} == {"shard-000000.json", "shard-000001.json"} and (
        len(list(folder.glob(".shard-*.tar"))) == 2
    )


def alive(group: int) -> list[int]:
    """The processes at work of a group; those that ended and that nobody waits for do not count."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, of = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(of) == group and state not in "ZX":
            found.append(int(path.parent.name))
    return found


# What is rendered


def test_dataset_holds_every_recipe_of_its_plan_once_in_order(rendered):
    plan = render_job.read_plan(rendered)
    renderer = DrawnRenderer(plan, None)
    found = []
    for shard in range(5):
        found += shards.read_samples(shards.tar_path(rendered, shard))
    assert [key for key, _ in found] == [renderer.recipe(index).key for index in range(23)]
    for index, (_, parts) in enumerate(found):
        assert parts == renderer.sample(renderer.recipe(index)).parts
    assert names(rendered) == {"dataset.json"} | {f"shard-00000{n}.{s}" for n in range(5) for s in ("tar", "json")}


def test_plan_says_what_it_is_made_of(rendered):
    plan = render_job.read_plan(rendered)
    expected = ["object", "train", "clean", 2020, 23, 5, 3, 0, False]
    assert [plan[name] for name in render_job.SETTINGS] == expected
    assert plan["maps"][2] == {"id": "00000002", "name": "own-2", "licence": "own"}
    assert plan["shapes"] == [{"id": "0a0a0a0a", "name": "sphere", "licence": "CC0"}]


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["object", "map"])
def test_command_renders_what_one_process_renders(drawn_command, tmp_path, kind):
    """Processes share the shards; the folder is the same byte for byte, and so says verify."""
    outcome = drawn_command("render", tmp_path / "a", *SMALL, "--kind", kind, "--workers", 2)
    assert outcome.status == 0, outcome.err
    assert outcome.out == ""
    render_job.render_missing(begin(tmp_path / "b", kind=kind), here, ignore)
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")
    assert outcome.err.splitlines()[0].endswith("23 pairs in 5 shards, 0 of them done")
    assert "complete" in outcome.err.splitlines()[-1]
    outcome = drawn_command("verify", tmp_path / "a", "--render", 23)
    assert (outcome.status, outcome.out) == (0, "5 shards good, 0 bad, 0 not rendered yet\n")


@pytest.mark.ci
def test_true_renderer_gives_the_same_in_processes_as_here(command, tmp_path):
    """A pair of a map and a shape of our own."""
    given = {"pairs": 1, "shard_size": 1, "procedural_maps": 1, "procedural_shapes": 1}
    options = [text for name, value in given.items() for text in (f"--{name.replace('_', '-')}", value)]
    outcome = command("data", "render", tmp_path / "a", *options)
    assert outcome.status == 0, outcome.err
    job = render_job.begin(tmp_path / "b", given, None, StoreRenderer, resume=False)
    render_job.render_missing(job, here, ignore)
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")


SOLID = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
SIDES = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]


@pytest.fixture
def assets(tmp_path) -> Path:
    """A folder with one map and one shape, and nothing that says whose they are."""
    noise = np.random.default_rng(3).gamma(1.0, 2.0, (16, 32, 3)).astype(np.float32)
    write_hdr(tmp_path / "data/hdri/train/hall.hdr", noise)
    (tmp_path / "data/meshes/train").mkdir(parents=True)
    (tmp_path / "data/meshes/train/solid.obj").write_bytes(obj(SOLID, SIDES))
    return tmp_path / "data"


def begin_true(folder: Path, data: Path, resume: bool = False, **given) -> tuple[render_job.RenderJob, list[str]]:
    """A dataset of the true renderer, and what it says."""
    said = []
    job = render_job.begin(folder, given, data, StoreRenderer, resume=resume, report=said.append)
    return job, said


@pytest.mark.ci
def test_folder_of_assets_with_a_bad_file(tmp_path, assets):
    """It is named when the dataset is begun; workers and verify leave it out as well."""
    (tmp_path / "data/hdri/train/cut.hdr").write_bytes(b"#?RADIANCE")
    for folder in ("hdri", "meshes"):
        (tmp_path / "data" / folder / "manifest.csv").write_text(
            "file,category,licence,split\n"
            + ("hall.hdr,indoor,CC0,train\ncut.hdr,indoor,CC0,train\n" if folder == "hdri" else "")
            + ("solid.obj,,CC0,train\n" if folder == "meshes" else "")
        )
    job, said = begin_true(tmp_path / "set", assets, pairs=1)
    assert len(said) == 1
    assert "cut.hdr" in said[0]
    render_job.render_missing(job, here, ignore)
    assert render_job.render_again(job, (0, (0,)), ignore) == ""
    plan = render_job.read_plan(tmp_path / "set")
    assert [(one["name"], one["licence"]) for one in plan["maps"] + plan["shapes"]] == [
        ("hall", "CC0"),
        ("solid", "CC0"),
    ]


def test_assets_of_unknown_licence_are_used_unless_told(tmp_path, assets, command):
    """They are the user's own; the plan says which, and --resume abides by it."""
    job, said = begin_true(tmp_path / "all", assets, pairs=1)
    assert said == []
    assert [one["licence"] for one in job.plan["maps"] + job.plan["shapes"]] == ["not stated"] * 2
    given = ("data", "render", tmp_path / "free", "--data", assets, "--commercial-only")
    outcome = command(*given)
    assert outcome.status == 2
    assert outcome.err.count("1 files left out, as their licence does not allow commercial use") == 2
    assert "got 0 and 0" in outcome.err.splitlines()[-1]
    for folder, name in (("hdri", "hall.hdr"), ("meshes", "solid.obj")):
        (assets / folder / "manifest.csv").write_text(f"file,licence,split\n{name},CC BY 4.0,train\n")
    free, _ = begin_true(tmp_path / "free", assets, pairs=1, commercial_only=True)
    assert free.plan["commercial_only"] is True
    begin_true(tmp_path / "free", assets, resume=True)
    with refused(source="all", naming="commercial only False"):
        begin_true(tmp_path / "all", assets, resume=True, commercial_only=True)


def test_shape_that_no_pixel_shows_is_left_out(tmp_path, assets):
    """A pole thinner than a pixel, however it is seen."""
    (assets / "meshes/train/pole.obj").write_bytes(obj(SOLID * [0.004, 1.0, 0.004], SIDES))
    job, said = begin_true(tmp_path / "set", assets, pairs=1)
    assert said == ["pole: expected a shape that photos can show, got one thinner than a pixel; left out"]
    assert [one["name"] for one in job.plan["shapes"]] == ["solid"]
    begin_true(tmp_path / "set", assets, resume=True)
    (assets / "meshes/train/solid.obj").unlink()
    with refused(source="dataset", naming="1 and 0"):
        begin_true(tmp_path / "other", assets)


# Stopped


@pytest.mark.ci
@pytest.mark.parametrize("victims", ["the command", "its whole group"])
def test_killed_render_goes_on_to_the_same_folder(start, drawn_command, rendered, tmp_path, victims):
    """kill -9 in the middle of two shards: nothing bad is left, --resume makes the rest and no more."""
    folder = tmp_path / "set"
    running = start(folder, *SMALL, DRAWN_STOP="12")
    wait_for(lambda: in_work(folder), running)
    if victims == "the command":  # its workers hang on
        running.kill()
    else:
        os.killpg(running.pid, signal.SIGKILL)
        wait_for(lambda: not alive(running.pid))
    running.wait()
    assert in_work(folder)
    for shard in (0, 1):
        assert shards.fault(folder, shard, "object", 5) == ""
    before = {path: path.stat().st_ino for path in folder.glob("shard-00000[01].*")}
    outcome = drawn_command("render", folder, "--resume")
    assert outcome.status == 0, outcome.err
    assert "5 shards, 2 of them done" in outcome.err
    assert snapshot(folder) == snapshot(rendered)
    assert {path: path.stat().st_ino for path in before} == before


@pytest.mark.ci
def test_workers_end_in_the_middle_of_a_shard_when_the_command_is_killed(start, tmp_path):
    """They do not render on unseen, for the twenty seconds that their shards would take."""
    folder = tmp_path / "set"
    given = ("--pairs", "400", "--shard-size", "200", *SMALL[4:])
    running = start(folder, *given, DRAWN_PAUSE_S="0.1")
    wait_for(lambda: len(list(folder.glob(".shard-*"))) == 2, running)
    running.kill()
    running.communicate()
    wait_for(lambda: not alive(running.pid))
    assert names(folder) == {"dataset.json"}


@pytest.mark.ci
def test_ctrl_c_says_how_to_go_on(start, drawn_command, rendered, tmp_path):
    """As a terminal sends it, to the command and its workers alike, here to these a little before."""
    folder = tmp_path / "a set"
    running = start(folder, *SMALL, DRAWN_STOP="12")
    wait_for(lambda: in_work(folder), running)
    for worker in set(alive(running.pid)) - {running.pid}:
        os.kill(worker, signal.SIGINT)
    time.sleep(0.5)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 130
    *_, how, last = said.splitlines()
    assert last == "anyprobe: interrupted"
    assert "Traceback" not in said
    assert f"resume with anyprobe data render '{folder}' --resume" in how
    wait_for(lambda: not alive(running.pid))  # multiprocessing's own helper ends a moment later
    assert not any(shards.is_temporary(path) for path in folder.iterdir())
    assert "stopped with 2 of 5 shards done" in how
    assert render_job.RenderJob(folder=folder, data=None, make=DrawnRenderer).missing() == [2, 3, 4]
    outcome = drawn_command("render", folder, "--resume")
    assert outcome.status == 0, outcome.err
    assert snapshot(folder) == snapshot(rendered)


@pytest.mark.ci
@pytest.mark.parametrize("deaths", [2, 3])
def test_dead_worker_is_reported_and_its_shard_done_again(tmp_path, rendered, drawn_command, monkeypatch, deaths):
    """Pair 12 kills whoever renders it; the third time the command gives up, all else stays."""
    counter = tmp_path / "deaths"
    counter.write_text(str(deaths))
    monkeypatch.setenv("DRAWN_DEATH", f"12 {counter}")
    folder = tmp_path / "set"
    outcome = drawn_command("render", folder, *SMALL)
    assert outcome.err.count("a worker died (signal 9); task 2 is repeated by another") == 2
    if deaths == 3:
        assert outcome.status == 2
        last = outcome.err.splitlines()[-1]
        assert last.startswith("anyprobe: task 2: expected a result, but its worker died 3 times")
        assert not shards.is_done(folder, 2)
        outcome = drawn_command("render", folder, "--resume")
    assert outcome.status == 0, outcome.err
    assert snapshot(folder) == snapshot(rendered)


@pytest.mark.ci
def test_workers_use_one_thread_each(monkeypatch):
    """Else they would fight for the cores, and sums would depend on how many there are."""
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    hints = run_local(drawn_pairs.thread_settings, [0], ignore, workers=1, log=print)
    assert hints == {0: ("1", "1")}
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_second_writer_is_refused(whole):
    shards.remove_shard(whole, 2)
    with render_job.locked(whole), refused(source="set", naming="another process"):
        render_job.render_missing(begin(whole, resume=True), here, ignore)
    render_job.render_missing(begin(whole, resume=True), here, ignore)
    assert shards.is_done(whole, 2)


def test_complete_dataset_is_left_alone(whole, drawn_command):
    before = {path: path.stat().st_mtime_ns for path in whole.iterdir()}
    assert drawn_command("render", whole, "--resume").status == 0
    assert {path: path.stat().st_mtime_ns for path in whole.iterdir()} == before


def test_progress_adds_up(tmp_path, monkeypatch):
    """Pairs told by shard, a dead worker's taken back, sum to the total."""
    job = begin(tmp_path / "set")
    shown = []
    progress = SimpleNamespace(
        add_task=lambda *_, **__: 0, update=lambda _, completed, rate: shown.append(completed), disable=False
    )
    watch = data_command._Watch(progress, render_job.job_status(job.folder))

    def twice(work, tasks, hints):
        hints(0, 4)
        hints(0, 0)
        here(work, tasks, hints)

    render_job.render_missing(job, twice, watch)
    assert shown == [4, 0, *range(1, 24)]


# Refused


@pytest.mark.parametrize(
    ("option", "value", "name"),
    [
        ("--kind", "map", "kind object, as the dataset was started, got map"),
        ("--split", "test", "split train"),
        ("--conditions", "world", "conditions clean"),
        ("--seed", 7, "seed 2020"),
        ("--pairs", 24, "pairs 23"),
        ("--shard-size", 6, "shard size 5"),
        ("--procedural-maps", 4, "procedural maps 3"),
        ("--procedural-shapes", 1, "procedural shapes 0"),
    ],
)
def test_resume_with_another_setting_is_refused(drawn_command, rendered, option, value, name):
    before = snapshot(rendered)
    complaint = drawn_command("render", rendered, "--resume", option, value).complaint
    assert complaint.startswith(f"anyprobe: set: --resume expected {name}")
    assert snapshot(rendered) == before


@pytest.mark.parametrize("version", ["anyprobe_version", "recipe_version", "procedural_version"])
def test_resume_by_another_version_is_refused(whole, version):
    plan = render_job.read_plan(whole)
    (whole / "dataset.json").write_text(json.dumps({**plan, version: "0.0.1"}))
    with pytest.raises(InputError, match=f"expected {version.replace('_', ' ')} 0.0.1"):
        begin(whole, resume=True)


@pytest.mark.parametrize("version", ["anyprobe_version", "recipe_version", "procedural_version"])
def test_repair_leaves_a_dataset_of_another_release_alone(whole, drawn_command, version):
    """Its shards are whole, though this release cannot read their recipes or would make others."""
    plan = render_job.read_plan(whole)
    (whole / "dataset.json").write_text(json.dumps({**plan, version: "0.0.1"}))
    if version == "recipe_version":
        for path in whole.glob("shard-*.json"):
            path.write_text(path.read_text().replace('"json"', '"recipe"'))  # bad by the rules of this one
    before = snapshot(whole)
    for options in ((), ("--repair",), ("--render", 3, "--repair")):
        complaint = drawn_command("verify", whole, *options).complaint
        assert f"expected {version.replace('_', ' ')} 0.0.1, as the dataset was started" in complaint
    assert snapshot(whole) == before


@pytest.mark.parametrize("links", [True, False])
def test_of_two_that_begin_at_once_one_is_refused(tmp_path, monkeypatch, links):
    """The second has loaded its assets while the first wrote its plan."""
    if not links:
        monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(PermissionError(1, "no links here")))
    folder, plans = tmp_path / "set", []

    class Slow(DrawnRenderer):
        def __init__(self, *arguments, **options) -> None:
            super().__init__(*arguments, **options)
            plans.append(begin(folder, seed=7).plan)

    with refused(source="dataset.json", naming="another process") as caught:
        render_job.begin(folder, {"procedural_maps": 3}, None, Slow, resume=False)
    assert "\n" not in str(caught.value)
    assert [render_job.read_plan(folder)] == plans
    assert plans[0]["seed"] == 7
    assert names(folder) == {"dataset.json"}


def test_resume_with_other_assets_is_refused(tmp_path, drawn_command):
    assets = tmp_path / "assets"
    assets.mkdir()
    (assets / "assets.txt").write_text("hall roof beach")
    begin(tmp_path / "set", data=assets, procedural_maps=0)
    missing = drawn_command("render", tmp_path / "set", "--resume").complaint
    assert missing.startswith("anyprobe: --data: expected the folder of assets")
    for text, said in (
        ("hall roof", "expected map 00000002 (beach), as the dataset was started, got none"),
        ("hall roof beach sky", "expected no map 00000003, as the dataset was started, got sky"),
    ):
        (assets / "assets.txt").write_text(text)
        assert said in drawn_command("render", tmp_path / "set", "--resume", "--data", assets).complaint
    (assets / "assets.txt").write_text("hall roof beach")
    assert begin(tmp_path / "set", resume=True, data=assets).missing() == [0, 1, 2, 3, 4]


def test_worker_on_another_machine_with_other_assets_refuses(tmp_path):
    """The check is made where the renderer is opened, not only where the command runs."""
    assets = tmp_path / "assets"
    assets.mkdir()
    (assets / "assets.txt").write_text("hall roof beach")
    job = begin(tmp_path / "set", data=assets, procedural_maps=0)
    (assets / "assets.txt").write_text("hall roof")
    with refused(source="set", naming="beach"):
        render_job.render_shard(job, 0, print)


def test_folder_with_something_in_it_is_refused(drawn_command, whole, tmp_path):
    before = snapshot(whole)
    assert "continue it with --resume" in drawn_command("render", whole, *SMALL).complaint
    assert snapshot(whole) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "photo.jpg").write_bytes(b"")
    assert "new or empty folder" in drawn_command("render", tmp_path / "mine", *SMALL).complaint
    assert "got a folder without dataset.json" in drawn_command("render", tmp_path / "mine", "--resume").complaint
    assert "got a file" in drawn_command("render", tmp_path / "mine" / "photo.jpg", *SMALL).complaint
    assert names(tmp_path / "mine") == {"photo.jpg"}


def test_bad_wishes_are_refused_and_leave_nothing(drawn_command, tmp_path):
    folder = tmp_path / "set"
    most = 3 * 8 * 23
    too_many = drawn_command("render", folder, "--procedural-maps", 3, "--pairs", most + 1).complaint
    assert f"expected 1 to {most}" in too_many
    assert "--engine ray" in drawn_command("render", folder, "--address", "auto").complaint
    for verb in ("status", "verify"):
        assert "got a folder without dataset.json" in drawn_command(verb, folder).complaint
    assert not folder.exists()


@pytest.mark.parametrize("damage", ["{", "[]", "{}", '{"format": 9}', '{"format": 2, "pairs": 0, "shard_size": 5}'])
def test_damaged_plan_is_refused(whole, drawn_command, damage):
    (whole / "dataset.json").write_text(damage)
    for verb in (("status", whole), ("verify", whole), ("render", whole, "--resume")):
        assert "dataset.json: expected" in drawn_command(*verb).complaint


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("maps", None, "'maps'"),
        ("shapes", None, "'shapes'"),
        ("shapes", [{"id": "0a0a0a0a"}], "asset"),
        ("kind", "film", "kind 'film'"),
        ("conditions", "space", "conditions 'space'"),
        ("pairs", 23.5, "pairs 23.5"),
        ("pairs", 0, "0 pairs"),
        ("seed", None, "'seed'"),
    ],
)
def test_plan_that_lacks_something_is_refused(whole, drawn_command, name, value, word):
    plan = json.loads((whole / "dataset.json").read_text())
    del plan[name]
    (whole / "dataset.json").write_text(json.dumps(plan if value is None else {**plan, name: value}))
    for verb in (("status", whole), ("verify", whole, "--repair"), ("render", whole, "--resume")):
        complaint = drawn_command(*verb).complaint
        assert "dataset.json: expected the plan of a dataset, got a damaged file" in complaint
        assert word in complaint


def test_folder_that_cannot_be_made_is_one_line(drawn_command, tmp_path):
    (tmp_path / "file").write_bytes(b"")
    complaint = drawn_command("render", tmp_path / "file" / "set", *SMALL).complaint
    assert "file is a file, not a folder; choose another folder" in complaint


@pytest.mark.ci
def test_worker_that_cannot_write_ends_the_command_with_one_line(tmp_path):
    """A limit on the size of files stands for a full disk."""
    folder = tmp_path / "set"
    begin(folder, pairs=40, shard_size=40)
    limited = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000));"
    limited += "from support import drawn_pairs; drawn_pairs.main()"
    ended = subprocess.run(
        [sys.executable, "-c", limited, "data", "render", str(folder), "--resume"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(TESTS)},
        timeout=PATIENCE_S,
    )
    assert ended.returncode == 2
    said, complaint = ended.stderr.splitlines()
    assert "0 of them done" in said
    assert "shard-000000.tar: cannot be written (File too large)" in complaint
    assert names(folder) == {"dataset.json"}


def test_too_small_a_disk_is_refused_before_the_work(whole, monkeypatch):
    """Half the shards are there: the rest will need as much again."""
    for shard in (0, 1, 4):
        shards.remove_shard(whole, shard)
    size = sum((whole / f"shard-00000{n}.tar").stat().st_size for n in (2, 3)) / 10
    job = begin(whole, resume=True)
    assert render_job.check_space(job, job.missing()) == pytest.approx(13 * size)
    for free, fits in ((13 * size - 1, False), (13 * size + 1, True)):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: SimpleNamespace(free=int(free)))
        if fits:
            render_job.render_missing(job, here, ignore)
        else:
            with refused(code="not-written", source="set", naming="3 shards"):
                render_job.render_missing(job, here, ignore)
            assert job.missing() == [0, 1, 4]


def test_shard_rendered_elsewhere_only_is_missed(tmp_path):
    """An engine whose machines do not share the folder."""
    with refused(code="not-written", source="set", naming="shard 0"):
        render_job.render_missing(begin(tmp_path / "set"), lambda *_: None, ignore)


# How far, and how good


def test_status_counts_what_the_pairs_say(whole, drawn_command):
    shards.remove_shard(whole, 1)
    shards.remove_shard(whole, 2)
    (whole / "shard-000004.tar").write_bytes(b"cut")
    hints = [
        decode_part("json", parts["json"])
        for shard in (0, 3)
        for _, parts in shards.read_samples(shards.tar_path(whole, shard))
    ]
    counts = Counter("specular" if one["specular"] else "diffuse" for one in hints)
    counts += Counter("indoor" if one["indoor"] else "outdoor" for one in hints)
    found = json.loads(drawn_command("status", whole, "--json").out)
    assert found["groups"] == counts
    assert sum(counts.values()) == 2 * 10
    size = sum(shards.tar_path(whole, n).stat().st_size for n in (0, 3))
    del found["groups"]
    assert found == {"shards": 5, "shards_done": 2, "pairs": 23, "pairs_done": 10, "bytes": size, "missing": [1, 2, 4]}
    printed = drawn_command("status", whole).out
    assert "shards 2 of 5" in printed
    assert f"specular {counts['specular']}, diffuse {counts['diffuse']}" in printed
    assert "missing shards 1-2, 4;" in printed


@pytest.mark.ci
def test_verify_names_bad_shards_and_repair_mends_them(whole, rendered, drawn_command):
    data = bytearray((whole / "shard-000001.tar").read_bytes())
    data[len(data) // 2] ^= 1
    (whole / "shard-000001.tar").write_bytes(data)
    (whole / "shard-000003.json").write_text("{}")
    shards.remove_shard(whole, 4)
    before = snapshot(whole)
    outcome = drawn_command("verify", whole)
    assert outcome.status == 2
    first, second, count, how = outcome.out.splitlines()
    assert first.startswith("shard-000001.tar: its bytes changed")
    assert second.startswith("shard-000003.tar: ")
    assert count == "2 shards good, 2 bad, 1 not rendered yet"
    assert "delete them" in how
    assert snapshot(whole) == before
    assert drawn_command("verify", whole, "--repair").status == 2
    assert {n for n in names(whole) if n.endswith("tar")} == {"shard-000000.tar", "shard-000002.tar"}
    assert drawn_command("render", whole, "--resume").status == 0
    assert snapshot(whole) == snapshot(rendered)


def changed(samples, place: int, part: str, change):
    """The same samples with another part somewhere, packed in good order."""
    for index, (key, parts) in enumerate(samples):
        if index == place:
            parts = {**parts, part: change(parts[part])}
        yield Sample(key=key, parts=parts)


def packed(picture: np.ndarray, **options) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", **options)
    return stream.getvalue()


def one_bit_off(data: bytes) -> bytes:
    picture = decode_part("photo.png", data).copy()
    picture[5, 5, 0] ^= 1
    return packed(picture)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("part", "change", "complaint"),
    [
        ("photo.png", one_bit_off, "photo.png differs when rendered again"),
        ("json", lambda data: data.replace(b'"alpha": 0.', b'"alpha": 0.1'), "again (alpha)"),
    ],
)
def test_pair_that_its_recipe_does_not_give_is_found(whole, drawn_command, part, change, complaint):
    """One value in one bit: the shard is sound in itself, only rendering again shows it."""
    old = list(shards.read_samples(whole / "shard-000002.tar"))
    shards.write_shard(whole, 2, changed(old, 3, part, change))
    assert drawn_command("verify", whole).status == 0
    outcome = drawn_command("verify", whole, "--render", 23)
    assert outcome.status == 2
    assert outcome.out.startswith("shard-000002.tar: ")
    assert complaint in outcome.out.splitlines()[0]


def test_pair_of_another_seed_is_found(whole, tmp_path):
    """Sound in every way, but the plan has other pairs at that place."""
    other = begin(tmp_path / "other", seed=1)
    render_job.render_shard(other, 0, lambda count: None)
    for suffix in ("tar", "json"):
        shutil.copy(tmp_path / "other" / f"shard-000000.{suffix}", whole)
    assert shards.fault(whole, 0, "object", 5) == ""
    job = render_job.RenderJob(folder=whole, data=None, make=DrawnRenderer)
    assert "is not in it" in render_job.render_again(job, (0, (0,)), lambda count: None)


def test_repacked_picture_is_the_same_picture(whole):
    """Another version of the PNG library may pack otherwise; the values count."""

    def repack(data: bytes) -> bytes:
        return packed(decode_part("photo.png", data), compress_level=0)

    old = list(shards.read_samples(whole / "shard-000000.tar"))
    shards.write_shard(whole, 0, changed(old, 0, "photo.png", repack))
    assert (whole / "shard-000000.tar").stat().st_size > 60_000
    job = render_job.RenderJob(folder=whole, data=None, make=DrawnRenderer)
    assert render_job.render_again(job, (0, tuple(range(5))), lambda count: None) == ""


def test_pairs_to_render_again_are_drawn_from_all(whole):
    """So many of them, each at most once, in the shards they are in."""
    tried = Counter()
    for _ in range(40):
        tasks = render_job.choose_pairs(render_job.read_plan(whole), [0, 2, 4], 3)
        numbers = [number for _, group in tasks for number in group]
        assert len(numbers) == len(set(numbers)) == 3
        assert all(number // 5 == shard for shard, group in tasks for number in group)
        tried.update(numbers)
    assert set(tried) <= {*range(5), *range(10, 15), *range(20, 23)}
    assert len(tried) > 10
    assert np.sum([len(group) for _, group in render_job.choose_pairs({"pairs": 23, "shard_size": 5}, [0], 99)]) == 5
