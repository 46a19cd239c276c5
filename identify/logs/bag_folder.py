"""ROS 2 bag folders: a metadata.yaml and the MCAP files that it names, which continue one another."""

from __future__ import annotations

import re
from pathlib import Path

from identify.errors import LogError
from identify.logs.wording import listed, printable

METADATA = "metadata.yaml"
_LARGEST = 1 << 24
_STORAGE = re.compile(r"^\s*storage_identifier:\s*['\"]?(\w*)", re.MULTILINE)
_COMPRESSION = re.compile(r"^\s*compression_mode:\s*['\"]?(\w+)", re.MULTILINE)
_FILES = re.compile(r"^(\s*)relative_file_paths:[ \t]*(\[[^\]]*\])?[ \t]*\n((?:\1[ \t]*-[^\n]*\n?)*)", re.MULTILINE)


def is_bag_folder(path: Path) -> bool:
    """Whether the folder is a ROS 2 bag."""
    return path.is_dir() and (path / METADATA).is_file()


def bag_files(folder: Path) -> tuple[list[Path], list[str]]:
    """The bag's MCAP files in the order of the recording, and findings on those that are missing.

    Of metadata.yaml only the list of files is read. Where it names none that are there, the folder's own MCAP
    files serve, by number. Raises LogError where there is no MCAP file.
    """
    text = ""
    if (folder / METADATA).stat().st_size <= _LARGEST:
        text = (folder / METADATA).read_text(encoding="utf-8", errors="replace")
    storage, compression = _STORAGE.search(text), _COMPRESSION.search(text)
    if storage and storage[1] not in ("", "mcap"):
        raise LogError(
            f"{folder}: is a bag stored as {printable(storage[1])}; "
            "`ros2 bag convert` makes one of MCAP of it, which can be read"
        )
    if compression and compression[1].lower() == "file":
        raise LogError(f"{folder}: its files are compressed whole; unpack them (zstd -d), and name the .mcap file")
    names = _named(text)
    # No bag names files outside of its own folder.
    inside = [name for name in names if Path(name).name == name]
    there = [folder / name for name in inside if (folder / name).is_file()]
    findings = []
    missing = [name for name in names if folder / name not in there]
    if there and missing:
        findings.append(f"the bag names files that are not there: {listed(missing)}")
    if not there:
        there = sorted(folder.glob("*.mcap"), key=lambda path: _by_number(path.name))
        if names and there:
            findings.append(f"{METADATA} names other files than there are; the folder's own were read")
    if not there:
        raise LogError(f"{folder}: is a bag without MCAP files; name the folder that holds them")
    return there, findings


def _named(text: str) -> list[str]:
    found = _FILES.search(text)
    if found is None:
        return []
    entries = (
        found[2][1:-1].split(",")
        if found[2]
        else [line.split("-", 1)[1] for line in found[3].split("\n") if line.strip()]
    )
    return [entry.strip().strip("'\"") for entry in entries if entry.strip()]


def _by_number(name: str) -> list[tuple[int, str]]:
    """A key by which bag_10 comes after bag_9."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"([0-9]+)", name)]
