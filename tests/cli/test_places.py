"""Where results may go: nothing is overwritten unasked, no input is lost, and no empty folder is left behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from identify.cli.places import check_file, check_folder, parents_of
from identify.errors import OutputError


def refuse(check, *arguments, **options) -> str:
    with pytest.raises(OutputError) as caught:
        check(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_file_is_replaced_by_force_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    check_file(str(path), (".csv",), force=False)
    path.write_text("old")
    assert "exists already; pass --force" in refuse(check_file, str(path), (".csv",), force=False)
    check_file(str(path), (".csv",), force=True)
    assert path.read_text() == "old"


def test_a_file_has_the_suffix_of_what_is_written_and_is_no_folder(tmp_path: Path) -> None:
    assert "must end in .mcap or .csv" in refuse(check_file, "a.txt", (".mcap", ".csv"), force=False)
    (tmp_path / "b.csv").mkdir()
    assert "is a folder" in refuse(check_file, str(tmp_path / "b.csv"), (".csv",), force=True)


def test_what_is_read_is_never_overwritten(tmp_path: Path) -> None:
    log = tmp_path / "run.csv"
    log.write_text("t,q1\n")
    (tmp_path / "link.csv").symlink_to(log)
    for name in ("run.csv", "link.csv"):
        message = refuse(check_file, str(tmp_path / name), (".csv",), force=True, inputs=[str(log)])
        assert "is read by this very command" in message
    folder = tmp_path / "result"
    folder.mkdir()
    (folder / "parameters.json").write_text("{}")
    (folder / "run.mcap").write_text("")
    message = refuse(check_folder, str(folder), "parameters.json", force=True, inputs=[str(folder / "run.mcap")])
    assert "holds files that this very command reads" in message


def test_a_folder_of_something_else_is_never_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "thesis"
    check_folder(str(folder), "parameters.json", force=False)
    folder.mkdir()
    assert "exists already" in refuse(check_folder, str(folder), "parameters.json", force=False)
    check_folder(str(folder), "parameters.json", force=True)
    (folder / "chapter.tex").write_text("")
    for force in (False, True):
        assert "something else than results" in refuse(check_folder, str(folder), "parameters.json", force=force)
    (folder / "parameters.json").write_text("{}")
    assert "pass --force" in refuse(check_folder, str(folder), "parameters.json", force=False)
    check_folder(str(folder), "parameters.json", force=True)
    assert "is a file" in refuse(check_folder, str(folder / "chapter.tex"), "parameters.json", force=True)


def test_a_place_below_a_file_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    for check, last in ((check_file, (".csv",)), (check_folder, "parameters.json")):
        assert "is a file, so there can be nothing in it" in refuse(check, str(tmp_path / "a/b/c.csv"), last, False)


def fail_below(path: Path) -> None:
    with parents_of(str(path)):
        assert path.parent.is_dir()
        raise ValueError("work")


def test_missing_folders_are_made_and_unmade_when_the_work_fails(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "c.csv"
    with pytest.raises(ValueError, match="work"):
        fail_below(path)
    assert not (tmp_path / "a").exists()
    with parents_of(str(path)):
        path.write_text("done")
    with pytest.raises(ValueError, match="work"):
        fail_below(path)
    assert path.read_text() == "done"
