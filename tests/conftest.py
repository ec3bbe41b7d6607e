"""What all tests share: --slow, random numbers, drawn photos, the command line in this process."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import shape_checks

shape_checks.install()

from support.scenes import sphere_photo  # noqa: E402

from anyprobe.cli.app import main  # noqa: E402
from anyprobe.estimate.estimator import Estimator  # noqa: E402
from anyprobe.estimate.result import Light  # noqa: E402
from anyprobe.masks.networks import small_network  # noqa: E402
from anyprobe.place.panorama import PANORAMA_SIZES, Panorama  # noqa: E402
from anyprobe.relight.insert import Stage  # noqa: E402
from anyprobe.relight.shadow import GroundShadow  # noqa: E402


@pytest.fixture(autouse=True)
def _own_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undo what the command line sets for the children of its process, which tests share."""
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # so that its absence is what monkeypatch comes back to
    monkeypatch.delenv("PYTHONSAFEPATH")


def pytest_configure() -> None:
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # by a shell that runs tests in the background; its children
        signal.signal(signal.SIGINT, signal.default_int_handler)  # would inherit it, and never end by Ctrl-C


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--ci", action="store_true", help="run the tests marked ci too, also where no file is named")
    parser.addoption("--slow", action="store_true", help="run the tests marked slow and ci too")


def leaves_out_ci(config: pytest.Config) -> bool:
    """Whether tests marked ci do not run: where nobody asks for them, and no file is named."""
    return not (
        config.getoption("--ci") or config.getoption("--slow") or any(".py" in argument for argument in config.args)
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--slow"):
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="slow: runs with --slow"))
    if leaves_out_ci(config):
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("ci")])
        items[:] = [item for item in items if not item.get_closest_marker("ci")]


def pytest_report_header(config: pytest.Config) -> str:
    return "without the tests marked ci, which --ci runs" if leaves_out_ci(config) else ""


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """The argument's name in the place of a whole file."""
    return argname if isinstance(val, bytes | str) and len(val) > 100 else None


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2020)


@pytest.fixture
def photo_rgba() -> np.ndarray:
    """[96, 128, 4] uint8, a shaded sphere with alpha."""
    return sphere_photo()


@pytest.fixture
def photo_mask(photo_rgba) -> np.ndarray:
    """[96, 128] uint8, 255 on the sphere."""
    return np.ascontiguousarray(photo_rgba[..., 3])


@pytest.fixture
def photo_path(tmp_path, photo_rgba) -> Path:
    """sphere.png with alpha, in a folder of its own."""
    path = tmp_path / "photos" / "sphere.png"
    path.parent.mkdir()
    Image.fromarray(photo_rgba).save(path)
    return path


@pytest.fixture
def mask_path(tmp_path, photo_mask) -> Path:
    path = tmp_path / "mask.png"
    Image.fromarray(photo_mask).save(path)
    return path


@pytest.fixture(scope="session")
def estimator() -> Estimator:
    return Estimator()


_kept = lru_cache(8)(Estimator)


@pytest.fixture
def networks_opened_once(monkeypatch) -> None:
    """The same Estimator kept between commands, as `command` keeps it: each would take half a second to open it."""
    monkeypatch.setattr("anyprobe.cli.options.Estimator", _kept)


@pytest.fixture
def small_results(monkeypatch) -> None:
    """The map alone in the place of the drawn preview, and panoramas of 64 rows: both take longer than the estimate."""
    monkeypatch.setattr("anyprobe.session.draw_preview", lambda panorama, *_: np.clip(panorama.radiance, 0, 1))
    full = Light.panorama

    def panorama(light: Light, size: int = 64, **given: object) -> Panorama:
        return full(light, 64 if size in PANORAMA_SIZES else size, **given)

    monkeypatch.setattr(Light, "panorama", panorama)


@pytest.fixture
def rough_shadows(monkeypatch) -> None:
    """Shadows of 32 directions on 64 x 64 cells, where no test looks at their grain."""
    for function in (Stage.shadow, GroundShadow.__init__):
        monkeypatch.setattr(function, "__defaults__", (32, 64))


@pytest.fixture
def small_masks(monkeypatch) -> None:
    """Objects are found by the bundled network, whatever is installed: U2-Net-p takes three seconds of a core."""
    for module in ("masks.find", "video.following"):
        monkeypatch.setattr(f"anyprobe.{module}.shared_network", small_network)


@pytest.fixture
def work(tmp_path, monkeypatch) -> Path:
    """An empty folder to stand in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a command ended."""

    status: int
    out: str
    err: str

    @property
    def complaint(self) -> str:
        """The one line on stderr of a command that refused its input with status 2."""
        assert self.status == 2, (self.status, self.err)
        assert self.out == ""
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("anyprobe: ")
        assert "Traceback" not in lines[0]
        return lines[0]


@pytest.fixture
def command(capfd, monkeypatch, networks_opened_once, small_results, rough_shadows) -> Callable[..., Outcome]:
    """The installed command's own entry point, or another, called in this process; its pictures are small."""

    def run(*arguments: object, main: Callable[[], None] = main) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["anyprobe", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "300")
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        captured = capfd.readouterr()
        return Outcome(status=end.value.code or 0, out=captured.out, err=captured.err)

    return run
