"""The page as a whole: complete, escaped, self-contained, repeatable, and honest about what is missing."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_results import example, rejected

from identify.errors import InputError, OutputError
from identify.report.page import render, write

SECTIONS = ["verdict", "prediction", "curves", "parameters", "friction", "physics", "data", "models", "residuals"]
SECTIONS += ["checks", "provenance"]
VOID = {"meta", "br", "path", "use", "rect", "circle"}
BLOCKS = "html head title style body main header nav section h1 h2 h3 h4 p ol ul li dl dt dd div details summary figure"
INLINE = "b i span small sub sup a code figcaption table thead tbody tr th td svg symbol g defs clippath text"
TAGS = {*VOID, *BLOCKS.split(), *INLINE.split()}
HOSTILE = """</style><script>alert(1)</script><img src=x onerror=alert(1)> "quoted' & ]]> 関節 \x00\ud800"""
LIMIT = 1_500_000  # bytes, from the report's specification


class Page(HTMLParser):
    """Tags, attributes and text of a page, and how deep in folds each text stands."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.visible: list[str] = []
        self.folded: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))
        if tag not in VOID or (self.get_starttag_text() or "").endswith("/>"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {k: v or "" for k, v in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" in self.open:
            return
        hidden = "details" in self.open and "summary" not in self.open
        (self.folded if hidden else self.visible).append(data)

    @property
    def seen(self) -> str:
        return " ".join(" ".join(self.visible).split())

    @property
    def text(self) -> str:
        return " ".join(" ".join([*self.visible, *self.folded]).split())


def check(html: str) -> Page:
    """What holds for every page: well formed, known tags, ids unique, every reference inside, nothing asked for."""
    page = Page(html)
    assert page.open == []
    assert {tag for tag, _ in page.elements} <= TAGS
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    targets = [attributes["href"] for _, attributes in page.elements if "href" in attributes]
    targets += re.findall(r"url\((.*?)\)", html)
    assert all(target.startswith("#") and target[1:] in ids for target in targets)
    assert not re.search(r"https?:|@import|\bsrc=", re.sub(r"&lt;.*?&gt;", "", html))
    names = {name for _, attributes in page.elements for name in attributes}
    assert not any(name.startswith("on") or name in ("src", "action", "style") for name in names)
    assert sorted(key for key in ids if key in SECTIONS) == sorted(SECTIONS)
    figures = [attributes for tag, attributes in page.elements if tag == "svg" and "viewbox" in attributes]
    assert all(a.get("aria-label") or a.get("aria-hidden") for a in figures)
    assert not re.search(r"<svg.*?(#[0-9a-f]{6}|rgb\()", html.partition("</style>")[2])
    assert len(html.encode()) <= LIMIT
    return page


@pytest.mark.parametrize(
    "options",
    [
        {"n": 2},
        {"n": 1, "test": False},
        {"n": 2, "simulated": False, "coupled": True},
        {"n": 2, "energy": True},
        {"n": 3, "prismatic": (1,)},
    ],
    ids=str,
)
def test_every_kind_of_result_makes_a_whole_page(options: dict[str, Any]) -> None:
    record, curves = example(**options)
    html = render(record, curves)
    page = check(html)
    assert re.findall(r'<section id="(\w+)"', html) == SECTIONS
    assert ("Simulated data" in page.seen) == record["simulated"]
    assert record["physical_reason"].capitalize() in page.seen
    assert "energy model" in page.text
    assert "torque model" in page.text
    forces = "force [N]" in page.text
    assert forces == bool(options.get("prismatic"))
    if options.get("coupled"):
        assert "Fsm" in html
        assert "coupled motors" in page.seen


def test_thirty_joints_stay_within_the_size_and_open_the_six_worst() -> None:
    record, curves = example(30)
    curves["test0/measured"][:, 17] += 40 * np.sin(curves["test0/time"])
    html = render(record, curves)
    check(html)
    curves_section = html.partition('<section id="curves">')[2].partition("</section>")[0]
    captions = re.findall(r"<figcaption><b>(.*?)</b>", curves_section.partition("<details>")[0])
    error = curves["test0/measured"] - curves["test0/predicted"]
    share = np.sqrt(np.mean((error * curves["test0/moving"]) ** 2, axis=0)) / curves["test0/measured"].std(axis=0)
    worst = [f"joint_{k + 1}" for k in np.argsort(-share)[:6]]
    assert captions == ["All joints", *worst]
    assert worst[0] == "joint_18"
    assert len(re.findall(r"<figcaption>", curves_section)) == 31


def test_a_rejected_log_gets_a_page_with_reasons_and_its_data() -> None:
    record, curves = rejected(2)
    html = render(record, curves)
    page = check(html)
    for text in (*record["verdict"]["reasons"], *record["verdict"]["actions"], "None was made", record["fit_reason"]):
        assert re.sub("`", "", text).lower() in page.seen.lower()
    assert "position [rad]" in page.seen
    assert "What was recorded?" in page.seen
    assert ">MET<" not in html
    assert re.findall(r'id="(\w+)"', html).count("parameters") == 1
    simulated, curves = rejected(1)
    simulated["simulated"] = True
    assert "Simulated data" in check(render(simulated, curves)).seen


def strings(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all strings of a record, keys aside."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from strings(inner, (*path, key))
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from strings(inner, (*path, k))
    elif isinstance(value, str):
        yield path


def put(record: Any, path: tuple[Any, ...], value: Any) -> None:
    for key in path[:-1]:
        record = record[key]
    record[path[-1]] = value


def at(record: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        record = record[key]
    return record


@pytest.mark.parametrize(
    "make", [lambda: example(2, coupled=True), lambda: example(1, test=False), lambda: rejected(1)]
)
def test_no_text_of_the_data_becomes_markup(make: Any) -> None:
    record, curves = make()
    for path in strings(record):
        put(record, path, at(record, path) + HOSTILE)
    html = render(record, curves)
    page = check(html)
    assert "<script" not in html
    assert "<img" not in html
    assert "\x00" not in html
    assert "<script>alert(1)</script>" in page.text
    html.encode()


def test_equal_input_gives_equal_bytes_from_any_thread() -> None:
    record, curves = example(2)
    before = copy.deepcopy(record)
    with ThreadPoolExecutor(2) as pool:
        pages = list(pool.map(lambda _: render(record, curves), range(2)))
    assert pages[0].encode() == pages[1].encode() == render(*example(2)).encode()
    assert record == before


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of every value of the record that may be missing: all but the list entries themselves."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not str(key).endswith("_reason"):
                yield (*path, key)
                yield from leaves(inner, (*path, key))
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from leaves(inner, (*path, k))


def test_any_value_may_be_missing() -> None:
    record, curves = example(1, coupled=True)
    paths = [p for p in leaves(record) if p[0] not in ("format", "names", "covariance", "versions")]
    rng = np.random.default_rng(7)
    for _ in range(8):
        broken = copy.deepcopy(record)
        for k in sorted(rng.choice(len(paths), 12, replace=False), key=lambda k: -len(paths[k])):
            put(broken, paths[k], None)
        check(render(broken, curves))
    bare = copy.deepcopy(record)
    for path in sorted(paths, key=len, reverse=True):
        if not isinstance(at(bare, path), (dict, list)):
            put(bare, path, None)
    check(render(bare, {}))
    check(render({"format": record["format"]}, {}))


def test_every_missing_value_shows_its_reason() -> None:
    record, curves = example(2, simulated=False)
    paths = [
        ("physical",),
        ("seed",),
        ("settings", "window_s"),
        ("fit", "condition_number"),
        ("fit", "per_joint", 1, "rest_rmse"),
        ("test", 0, "nominal_relative_residual_percent"),
        ("test", 0, "per_joint", 0, "moving_rmse"),
        ("coverage", "per_joint", 0, "velocity_limit_percent"),
        ("models", "energy"),
        ("cross_check", "mujoco"),
        ("cross_check", "identified"),
        ("logs", 0, "noise"),
        ("base_parameters", 0, "truth"),
        ("base_parameters", 1, "prior"),
        ("base_parameters", 2, "std"),
        ("friction", 1, "coulomb"),
        ("verdict", "uses", 1, "result"),
        ("robot", "joints", 0, "limits", "position"),
    ]
    for k, path in enumerate(paths):
        put(record, path, None)
        put(record, (*path[:-1], f"{path[-1]}_reason"), f"because of reason number {k}.")
    text = check(render(record, curves)).text.lower()
    for k in range(len(paths)):
        assert f"because of reason number {k}." in text


@pytest.mark.parametrize("name", ["fit", "coverage", "settings", "cross_check", "base_parameters", "friction"])
def test_a_missing_part_shows_its_reason_in_its_own_section(name: str) -> None:
    record, curves = example(1)
    record[name], record[f"{name}_reason"] = None, "the moon was full"
    html = render(record, curves)
    check(html)
    own = {"fit": "prediction", "coverage": "data", "settings": "data", "cross_check": "checks"}
    key = own.get(name, "parameters" if name == "base_parameters" else name)
    section = html.partition(f'<section id="{key}">')[2].partition("</section>")[0]
    assert "The moon was full." in section


def test_without_a_test_log_nothing_counts_as_tested() -> None:
    record, curves = example(1, test=False)
    for use in record["verdict"]["uses"]:
        use["status"] = "MET"
    html = render(record, curves)
    words = re.findall(r'<span class="state [^"]*"><svg.*?</svg>(.*?)</span>', html.partition('id="curves"')[0])
    assert words == ["NOT TESTED"] * 4
    assert "has not been tested" in check(html).seen


def test_warnings_are_never_folded() -> None:
    record, curves = example(2)
    record["verdict"].update(status="warn", reasons=["the wrist is worse than the robot file"])
    record["cross_check"]["mujoco"]["max_abs_error"] = 3e-3
    record["logs"][1]["findings"] = ["2 rows with NaN were dropped"]
    page = check(render(record, curves))
    for text in (
        "The wrist is worse than the robot file.",
        "41 rows with no effort were dropped (0.14 %).",
        "2 rows with NaN were dropped.",
        "joint_2 3.2 % of its time",
        "differs from MuJoCo by 0.0030, relative",
    ):
        assert text in page.seen
    for text in ("sha256", "Coverage of the training motion", "With every column scaled"):
        assert text not in page.seen
        assert text in page.text


def test_figures_of_the_record_are_the_figures_of_the_page() -> None:
    record, curves = example(2, noise=0.1)
    row = record["test"][0]["per_joint"][0]
    row.update(moving_rmse=0.4017, rest_rmse=1.6702, std_of_signal=8.034, nominal_moving_rmse=0.2, max_abs_error=3.1)
    parameter = record["base_parameters"][1]
    parameter.update(name="XXR2", estimate=0.15203, std=0.0478, truth=0.2476, unit="kg·m²", identified=True)
    record["base_parameters"][2].update(name="XY2", estimate=0.01, std=0.144894, unit="kg·m²")
    html = render(record, curves)
    line = re.search(r'<th scope="row" class="text">joint_1</th>(.*?)</tr>', html)
    assert line
    cells = [re.sub("<.*?>", "", c) for c in re.findall(r"<td.*?>(.*?)</td>", line.group(1))]
    assert [float(c) for c in cells[:3]] == pytest.approx([0.40, 1.67, 0.20], rel=0.03)
    assert float(cells[4]) == pytest.approx(5.0, abs=0.01)
    assert cells[-1] == "no better than nominal"
    line = re.search(r'<th scope="row" class="text">XXR<sub>2</sub></th>(.*?)</tr>', html)
    assert line
    cells = [re.sub("<.*?>", "", c) for c in re.findall(r"<td.*?>(.*?)</td>", line.group(1))]
    assert cells[1:4] == ["0.152", "± 0.048", "kg·m²"]
    assert cells[-3:] == ["0.248", "−2.00", "identified"]
    assert "|x| &lt; 0.30" in html


def test_a_limit_in_the_record_gives_each_joint_its_verdict() -> None:
    record, curves = example(2)
    record["verdict"]["uses"][0].update(limit_percent=10.0, limit_source="the works")
    rows = record["test"][0]["per_joint"]
    rows[0].update(moving_rmse=1.01, std_of_signal=10.0, nominal_moving_rmse=None)
    rows[1].update(moving_rmse=0.99, std_of_signal=10.0, nominal_moving_rmse=2.0)
    section = render(record, curves).partition('<section id="prediction">')[2].partition("</section>")[0]
    words = re.findall(r'<td class="word">(.*?)</td>', section)
    assert [re.sub("<.*?>", "", word) for word in words] == ["NOT MET", "MET, better than nominal"]
    assert "10 % of the signal’s std (the works)" in section
    del record["verdict"]["uses"][0]["limit_percent"]
    for row in rows:
        row["nominal_moving_rmse"] = None
    section = render(record, curves).partition('<section id="prediction">')[2].partition("</section>")[0]
    assert '<th scope="col" class="word">' not in section


def test_estimates_are_held_against_the_truth_in_sigmas() -> None:
    record, curves = example(2)
    for k, parameter in enumerate(record["base_parameters"]):
        parameter.update(estimate=10.0 + (3.0 if k == 1 else 1.0), std=1.0, truth=10.0)
    for row in record["friction"]:
        for key in ("viscous", "coulomb", "offset"):
            row[key].update(estimate=4.0, std=2.0, truth=6.0)
    count = len(record["base_parameters"]) + 6
    spread = np.sqrt((count - 1 + 9) / count)
    name = record["base_parameters"][1]["name"].replace("2", "₂")
    told = f"{count} estimates are off by {spread:.1f} σ in the root mean square"
    seen = check(render(record, curves)).seen
    assert told in seen
    assert f"by 3.0 σ at most, {name}" in seen


def test_estimators_stand_side_by_side_and_a_dropped_constant_says_why() -> None:
    record, curves = example(1)
    residuals = {"relative_residual_percent": 2.25, "moving_relative_residual_percent": 1.125}
    why = "the log does not tell its controller"
    record["estimators"] = [
        {"estimator": "ols", "title": "ordinary least squares", "model": "torque", "default": False}
        | {"condition_number": 31.0, "train": residuals, "test": residuals},
        {"estimator": "wls", "title": "weighted least squares", "model": "torque", "default": True}
        | {"condition_number": 28.0, "train": residuals, "test": None, "test_reason": "no held-out log was given"}
        | {"why": "No other is more accurate."},
        {"estimator": "didim", "title": "a closed loop", "model": "torque", "default": False, "reason": why},
    ]
    record["friction"][0].update(offset=None, offset_reason="off1 can't be told from MX1, which holds it")
    html = render(record, curves)
    page = check(html)
    models = html.partition('<section id="models">')[2].partition("</section>")[0]
    table = models.partition("<h3>Estimators</h3>")[2].partition("</table>")[0]
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)[1:]]
    assert rows[0] == ["ols", "ordinary least squares", "torque", "1.12", "1.12", "2.25", "31"]
    assert rows[1][:4] == ["<b>wls</b>, default", "weighted least squares", "torque", "1.12"]
    for text in (
        "No held-out log was given.",
        f"{why.capitalize()}.",
        "3 estimators side by side",
        "No other is more accurate",
    ):
        assert text in page.text
    assert "off1 can't be told from MX1, which holds it." in page.text
    assert html.count("off<sub>1</sub>") >= 1


def test_colours_are_those_of_the_specification() -> None:
    html = render(*example(1))
    light, _, dark = html.partition("@media screen and (prefers-color-scheme: dark)")
    for name, day, night in (
        ("measured", "#1a1a1a", "#e8e8e8"),
        ("predicted", "#0072b2", "#56b4e9"),
        ("error", "#b34700", "#f5a623"),
    ):
        assert f"--{name}: {day}" in light
        assert f"--{name}: {night}" in dark
        assert f"var(--{name})" in html
    assert "details::details-content" in html.partition("@media print")[2]


def folder_with(path: Path, record: Any, curves: dict[str, np.ndarray] | None = None) -> Path:
    path.mkdir()
    (path / "parameters.json").write_text(json.dumps(record), encoding="utf-8")
    if curves is not None:
        np.savez(path / "curves.npz", **curves)
    return path


def test_write_reads_the_folder_and_replaces_the_report_whole(tmp_path: Path) -> None:
    record, curves = example(1)
    folder = folder_with(tmp_path / "result", record, curves)
    (folder / "report.html").write_text("old")
    path = write(folder)
    assert path == folder / "report.html"
    assert path.read_text(encoding="utf-8") == render(record, curves)
    assert sorted(p.name for p in folder.iterdir()) == ["curves.npz", "parameters.json", "report.html"]


def test_write_does_without_arrays(tmp_path: Path) -> None:
    page = check(write(folder_with(tmp_path / "result", example(1)[0])).read_text(encoding="utf-8"))
    assert "the result folder holds no arrays" in page.seen.lower()


def test_what_is_no_result_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    broken = folder_with(tmp_path / "broken", {})
    cases = [(tmp_path / "none", "not found"), (broken, "format")]
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "parameters.json").write_text("{", encoding="utf-8")
    cases.append((tmp_path / "text", "not JSON"))
    arrays = folder_with(tmp_path / "arrays", example(1)[0])
    (arrays / "curves.npz").write_bytes(b"PK\x03\x04 nothing")
    cases.append((arrays, "not a file of arrays"))
    for folder, message in cases:
        with pytest.raises(InputError, match=message) as caught:
            write(folder)
        assert "\n" not in str(caught.value)
        assert str(folder) in str(caught.value)
        assert not (folder / "report.html").exists()


def test_a_report_that_cannot_be_replaced_is_refused_and_leaves_nothing_behind(tmp_path: Path) -> None:
    folder = folder_with(tmp_path / "result", example(1)[0])
    (folder / "report.html").mkdir()
    with pytest.raises(OutputError, match=r"report\.html"):
        write(folder)
    assert sorted(p.name for p in folder.iterdir()) == ["parameters.json", "report.html"]
