"""Files that are whole whenever power fails: on the disk before they replace others."""

from __future__ import annotations

import errno
import os
import stat

import pytest

from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput

CONTENT = b"x" * 70_000  # more than a buffer of Python


@pytest.fixture
def events(monkeypatch):
    """What reaches the disk, in order: a file with its size, a folder by its name, a replacement."""
    said = []
    fsync = os.fsync
    replace = os.replace

    def flushed(handle):
        about = os.fstat(handle)
        folder = stat.S_ISDIR(about.st_mode)
        said.append(
            ("folder", os.path.basename(os.readlink(f"/proc/self/fd/{handle}")))
            if folder
            else about.st_size
        )
        fsync(handle)

    def replaced(old, new):
        said.append("replaced")
        replace(old, new)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(os, "replace", replaced)
    return said


def test_a_whole_file_is_on_the_disk_before_it_replaces_the_old_one(tmp_path, events):
    for _ in range(2):
        write_atomically(tmp_path / "result.json", lambda file: file.write(CONTENT))
    assert events == [len(CONTENT), "replaced", ("folder", tmp_path.name)] * 2
    assert (tmp_path / "result.json").read_bytes() == CONTENT


def test_new_folders_are_on_the_disk_before_their_file(tmp_path, events):
    write_atomically(tmp_path / "reports" / "parts" / "part", lambda file: file.write(CONTENT))
    folders = events[:2]
    rest = events[2:]
    assert sorted(folders) == sorted([("folder", tmp_path.name), ("folder", "reports")])
    assert rest == [len(CONTENT), "replaced", ("folder", "parts")]


def test_a_file_that_the_disk_refuses_leaves_the_old_one(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(errno.EIO, "Input/output error")

    path = tmp_path / "result.json"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(BadInput, match=r"result\.json: cannot be written: Input/output error"):
        write_atomically(path, lambda file: file.write(CONTENT))
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["result.json"]


def test_a_folder_that_cannot_be_flushed_is_no_error(tmp_path, monkeypatch):
    def network(handle):
        if stat.S_ISDIR(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", network)
    write_atomically(tmp_path / "new" / "result.json", lambda file: file.write(CONTENT))
    assert (tmp_path / "new" / "result.json").read_bytes() == CONTENT
