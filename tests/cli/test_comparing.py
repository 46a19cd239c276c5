"""`identify compare`: text, object and page, and the usual manners."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from compared_results import WORN, result
from exact_logs import arm


@pytest.fixture
def folders(tmp_path, monkeypatch) -> tuple[str, str]:
    monkeypatch.chdir(tmp_path)
    result("before", 1).save("march")
    result("worn", 4).save("april")
    return "march", "april"


def test_text_object_and_page(run, folders) -> None:
    told = run("compare", *folders)
    assert told.status == 0
    assert told.out.startswith("A  march: ")
    assert f"it changed on {arm(1).joint_names[WORN - 1]} at" in told.out
    assert not Path("page.html").exists()
    found = json.loads(run("compare", *folders, "--json", "-o", "new/page.html").out)
    assert found["format"] == "identify/comparison/1"
    assert [row["state"] for row in found["findings"]][:2] == ["CHANGED", "NO CHANGE SEEN"]
    page = Path("new/page.html").read_bytes()
    refused = run("compare", *folders, "-o", "new/page.html")
    assert (refused.status, Path("new/page.html").read_bytes()) == (2, page)
    assert "--force" in refused.err
    again = run("compare", *folders, "-o", "new/page.html", "--force")
    assert (again.status, Path("new/page.html").read_bytes()) == (0, page)
    assert "page: new/page.html" in again.out


def test_what_can_not_be_compared_is_told_in_a_line(run, folders) -> None:
    for arguments, words in (
        (("march", "nowhere"), "is no result folder"),
        (("march", "april", "-o", "page.pdf"), "must end in .html"),
    ):
        found = run("compare", *arguments)
        assert (found.status, len(found.err.splitlines())) == (2, 1)
        assert words in found.err
    assert sorted(path.name for path in Path().iterdir()) == ["april", "march"]
