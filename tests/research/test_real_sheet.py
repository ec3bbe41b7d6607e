"""The sheet of real photos: one row a photo, with the masks that the folders have where they are asked for."""

import numpy as np
import pytest
from PIL import Image
from support.scenes import sphere_photo

from anyprobe.errors import InputError
from research.real_photos import sheet
from research.real_photos.folders import masked_photos, masks_of, photos_of


@pytest.fixture
def folders(tmp_path):
    """A folder of a photo with its own mask and one without, and one of two photos that share a mask."""
    photo = sphere_photo(center=(64, 50), diameter=40)
    for folder, names in (("own", ("a", "b")), ("shared", ("c", "d"))):
        (tmp_path / folder).mkdir()
        for name in names:
            Image.fromarray(photo[..., :3]).save(tmp_path / folder / f"{name}.png")
    Image.fromarray(photo[..., 3]).save(tmp_path / "own" / "a_mask.png")
    Image.fromarray(photo[..., 3]).save(tmp_path / "shared" / "ball_mask.png")
    (tmp_path / "shared" / "lights.csv").write_text(
        "file,mask,object,x,y,z\nc.png,ball_mask.png,ball,0,0,1\nd.png,ball_mask.png,ball,0,0,1\n"
    )
    return [tmp_path / "own", tmp_path / "shared"]


def test_masks_are_the_photo_s_own_or_those_of_the_table(folders):
    own, shared = folders
    assert [path.name for folder in folders for path in photos_of(folder)] == ["a.png", "b.png", "c.png", "d.png"]
    assert masks_of(own) == {own / "a.png": own / "a_mask.png"}
    assert {path.name: mask.name for path, mask in masks_of(shared).items()} == dict.fromkeys(
        ("c.png", "d.png"), "ball_mask.png"
    )
    assert list(masked_photos(folders)) == ["own/a.png", "shared/c.png", "shared/d.png"]
    (own / "a_mask.png").unlink()
    with pytest.raises(InputError, match="own: expected photos with NAME_mask.png beside them, found none"):
        masked_photos(folders)


@pytest.mark.parametrize("masks", [False, True])
def test_every_photo_has_a_row_and_masks_are_given_where_asked_for(folders, tmp_path, monkeypatch, masks):
    given = {}

    def row(path, mask, estimators):
        given[path.name] = mask and mask.name
        return sheet.strip([[(path.name, np.full((10, 20, 3), 0.5))]])

    monkeypatch.setattr(sheet, "row_of", row)
    monkeypatch.setattr(sheet, "PAGE", 3)
    sheet.main(folders, tmp_path / "out", ["lift"], masks)
    found = ("a_mask.png", None, "ball_mask.png", "ball_mask.png") if masks else (None,) * 4
    assert given == dict(zip(("a.png", "b.png", "c.png", "d.png"), found, strict=True))
    height = sheet.ROW + sheet.CAPTION
    for page, rows in (("page_0.jpg", 3), ("page_1.jpg", 1)):
        with Image.open(tmp_path / "out" / page) as opened:
            assert opened.size == (2 * sheet.ROW, rows * height)
