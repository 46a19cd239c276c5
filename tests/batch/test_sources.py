"""Which files of a folder are logs, what is held out, and what results are called."""

from __future__ import annotations

from pathlib import Path

import pytest

from identify.batch.sources import Source, find_sources
from identify.errors import LogError


def made(top: Path, *names: str) -> Path:
    for name in names:
        path = top / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"t,q1,tau1\n" if name.endswith("own.csv") else b"x,y\n")
    return top


def told(top: Path, **options: object) -> list[tuple[str, str, str]]:
    """(file, name, unit) of each source."""
    sources, _ = find_sources(top, **options)  # type: ignore[arg-type]
    return [(Path(s.log).relative_to(top).as_posix(), s.name, s.unit) for s in sources]


def test_logs_of_a_folder_and_its_sub_folders(tmp_path: Path) -> None:
    made(tmp_path, "b.mcap", "a.mcap", "a.truth.json", "notes.txt", "x.csv", "own.csv", ".hidden.mcap", ".git/y.mcap")
    made(tmp_path, "arm 1/run.mcap", "arm 1/day/run.mcap", "bag/metadata.yaml", "bag/bag_0.mcap", "bag/bag_1.mcap")
    assert told(tmp_path) == [
        ("a.mcap", "a", ""),
        ("arm 1/day/run.mcap", "arm 1/day/run", "arm 1/day"),
        ("arm 1/run.mcap", "arm 1/run", "arm 1"),
        ("b.mcap", "b", ""),
        ("bag", "bag", ""),
        ("own.csv", "own", ""),
    ]
    assert [Path(other).name for other in find_sources(tmp_path)[1]] == ["notes.txt", "x.csv"]
    assert ("x.csv", "x", "") in told(tmp_path, tables=True)


def test_results_are_no_logs(tmp_path: Path) -> None:
    made(tmp_path, "a.mcap", "old/summary.json", "old/a/parameters.json", "old/a/curves.npz", "result/parameters.json")
    made(tmp_path, "result/curves.npz", "result/kept.mcap")
    assert told(tmp_path, tables=True) == [("a.mcap", "a", "")]


def test_no_two_results_stand_in_one_place(tmp_path: Path) -> None:
    made(tmp_path, "a.mcap", "a.own.csv", "b.mcap", "b/c.mcap", "summary.csv.mcap", "summary.mcap")
    names = {name: file for file, name, _ in told(tmp_path)}
    assert names == {
        "a": "a.mcap",
        "a.own": "a.own.csv",
        "b.mcap": "b.mcap",
        "b/c": "b/c.mcap",
        "summary.csv.mcap": "summary.csv.mcap",
        "summary": "summary.mcap",
    }
    made(tmp_path, "d.mcap", "d.npz")
    both = [name for _, name, _ in told(tmp_path, tables=True) if name.startswith("d")]
    assert both == ["d.mcap", "d.npz"]


def test_held_out_logs_are_known_by_their_names(tmp_path: Path) -> None:
    made(tmp_path, "a.mcap", "a.test.mcap", "b.mcap", "c.test.mcap", "common.mcap")
    sources, _ = find_sources(tmp_path, test=[str(tmp_path / "common.mcap")])
    common = str(tmp_path / "common.mcap")
    assert sources == [
        Source(str(tmp_path / "a.mcap"), "a", "", (str(tmp_path / "a.test.mcap"), common)),
        Source(str(tmp_path / "b.mcap"), "b", "", (common,)),
        Source(str(tmp_path / "c.test.mcap"), "c.test", "", (common,)),
    ]


@pytest.mark.parametrize(
    ("names", "place", "message"),
    [
        (["notes.txt", "x.csv"], ".", "holds no log to fit; logs may be MCAP; for tables, pass --map"),
        (["a.mcap"], "a.mcap", "is a file; a batch takes a folder"),
        (["a.mcap"], "nowhere", "there is no such folder"),
        (["metadata.yaml", "a_0.mcap"], ".", "is a single bag"),
    ],
)
def test_what_is_no_folder_of_logs_is_one_line(names: list[str], place: str, message: str, tmp_path: Path) -> None:
    made(tmp_path, *names)
    with pytest.raises(LogError, match=message):
        find_sources(tmp_path / place)
