"""Progress: one line on a terminal, silence elsewhere."""

from __future__ import annotations

import io

from identify.cli.progress import progress_line


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_one_line_and_is_left_clean() -> None:
    terminal = Terminal()
    with progress_line(terminal) as show:
        assert show is not None
        show(0.0, "reading")
        show(0.5, "fitting")
        show(2.0, "writing " + 500 * "x")
    parts = terminal.getvalue().split("\r\x1b[K")
    assert parts[0] == ""
    assert parts[1:3] == ["  0 %  reading", " 50 %  fitting"]
    assert parts[3].startswith("100 %  writing x")
    assert len(parts[3]) < 500
    assert parts[4:] == [""]
    assert "\n" not in terminal.getvalue()


def test_updates_in_quick_succession_are_left_out_but_never_a_new_text() -> None:
    terminal = Terminal()
    with progress_line(terminal) as show:
        assert show is not None
        for step in range(1000):
            show(step / 1000, "one")
        show(0.999, "two")
    shown = terminal.getvalue().split("\r\x1b[K")
    assert 2 < len(shown) < 200
    assert shown[-2] == "100 %  two"


def test_the_line_goes_when_the_work_fails() -> None:
    terminal = Terminal()
    try:
        with progress_line(terminal) as show:
            assert show is not None
            show(0.1, "reading")
            raise ValueError
    except ValueError:
        pass
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_no_terminal_no_progress() -> None:
    stream = io.StringIO()
    with progress_line(stream) as show:
        assert show is None
    assert stream.getvalue() == ""
