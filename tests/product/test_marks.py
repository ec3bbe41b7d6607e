"""Boxes and clicks for a folder, from a CSV file."""

from __future__ import annotations

import json

import pytest
from PIL import Image
from support.refused import refused

from anyprobe.cli.photo_files import marks_of, read_marks


def test_rows_are_read_in_each_usual_form(tmp_path):
    path = tmp_path / "marks.csv"
    wanted = {"a.png": {"box": (1.0, 2.0, 30.0, 40.0)}, "b.png": {"click": [(5.0, 6.0), (7.0, 8.0)]}}
    for text in (
        'photo,box,click\na.png,"1,2,30,40",\nb.png,,"5,6;7,8"\n',
        "\ufeffphoto;box;click\r\nphotos/a.png;1,2,30,40;\r\nphotos\\b.png;;5,6 7,8\r\n",
        "photo\tclick\tbox\na.png\t\t1,2,30,40\nb.png\t5,6;7,8\n",
        "sep=;\r\nPhoto;Box;Click;\r\na.png;1,2,30,40;;\r\nb.png;;5,6 7,8;\r\n;;;\r\n",
        '"sep=,"\rphoto,click,box\ra.png,,"1,2,30,40"\rb.png,"5,6;7,8",\r',
    ):
        path.write_text(text, encoding="utf-8", newline="")
        assert read_marks(path) == wanted


def test_a_spreadsheet_s_unicode_text_is_read_and_another_encoding_is_named(tmp_path):
    path = tmp_path / "marks.csv"
    path.write_bytes("photo\tclick\r\nä.png\t5,6\r\n".encode("utf-16"))
    assert read_marks(path) == {"ä.png": {"click": [(5.0, 6.0)]}}
    path.write_bytes('photo,click\nä.png,"5,6"\n'.encode("latin-1"))
    with refused(naming="UTF-8"):
        read_marks(path)


@pytest.mark.parametrize(
    ("text", "naming", "subject"),
    [
        ("photo,clik\n", "did you mean click?", ()),
        ("box\n", "no column photo", ()),
        ("", "no column photo", ()),
        ('photo,box\na.png,"1,2"\n', "X0,Y0,X1,Y1", ("box",)),
        ("photo,box\na.png,1,2,3,4\n", "quote", ()),
        ('photo,box\na.png,"1,2,3,4"\na.png,"1,2,3,4"\n', "a.png again", ()),
        ('photo,box\nb.png,"1,2,3,4"\n', "'b.png'", ()),
        ('photo,box\nimg_1.png,"1,2,3,4"\n', "did you mean IMG_1.PNG?", ()),
        ("sep=\t\nphoto\tbox\na.png\t1,2\n", "X0,Y0,X1,Y1", ("box",)),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, text, naming, subject):
    path = tmp_path / "marks.csv"
    path.write_text(text)
    with refused(*subject, naming=naming):
        marks_of(path, [tmp_path / "a.png", tmp_path / "IMG_1.PNG"])


@pytest.mark.ci
def test_each_photo_of_a_folder_gets_its_own(command, work, photo_rgba):
    (work / "photos").mkdir()
    for name in ("a.png", "b.png"):
        Image.fromarray(photo_rgba[..., :3]).save(work / "photos" / name)
    (work / "marks.csv").write_text('photo,box,click\na.png,"20,10,100,90",\nb.png,,"64,48"\n')
    done = command("mask", "photos", "--marks", "marks.csv", "--json", "-q")
    assert done.status == 0, done.err
    assert [json.loads(line)["source"] for line in done.out.splitlines()] == ["box", "click"]
