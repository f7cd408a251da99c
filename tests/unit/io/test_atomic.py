from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

import pytest

from landtool.errors import InputError, OutputError, OutputExistsError, UsageError
from landtool.io import atomic
from landtool.io.atomic import (
    RESUME_PREFIX,
    TEMPORARY_PREFIX,
    atomic_folder,
    atomic_path,
    refuse_input_as_output,
    resumable_folder,
)
from tests.limits import files_of_at_most


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def write_and_fail(path: Path, error: BaseException) -> None:
    path.write_text("half")
    raise error


def write_small_and_large(folder: Path) -> None:
    """Write two files, of which the second does not fit on the disk."""
    (folder / "small").write_text("x")
    with files_of_at_most(4096):
        (folder / "large").write_bytes(bytes(10_000))


class TestFile:
    def test_appears_only_at_the_end(self, tmp_path: Path) -> None:
        target = tmp_path / "new" / "deep" / "clip.mp4"
        with atomic_path(target) as temporary:
            assert temporary.parent == target.parent
            assert temporary.suffix == ".mp4"
            assert temporary.name.startswith(TEMPORARY_PREFIX)
            temporary.write_text("whole")
            assert not target.exists()
        assert target.read_text() == "whole"
        assert names(tmp_path) == ["new", "new/deep", "new/deep/clip.mp4"]

    def test_honours_the_umask(self, tmp_path: Path) -> None:
        old = os.umask(0o027)
        try:
            with atomic_path(tmp_path / "a") as temporary:
                temporary.write_text("x")
        finally:
            os.umask(old)
        assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640

    @pytest.mark.parametrize("error", [ValueError("x"), KeyboardInterrupt(), SystemExit(143), InputError("bad")])
    def test_any_exception_leaves_nothing(self, tmp_path: Path, error: BaseException) -> None:
        with pytest.raises(type(error)) as caught, atomic_path(tmp_path / "new" / "a.csv") as temporary:
            write_and_fail(temporary, error)
        assert caught.value is error
        assert names(tmp_path) == []

    def test_parents_used_by_others_stay(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="x"), atomic_path(tmp_path / "new" / "a.csv"):
            write_and_fail(tmp_path / "new" / "theirs", ValueError("x"))
        assert names(tmp_path) == ["new", "new/theirs"]

    def test_refuses_an_existing_target_before_any_work(self, tmp_path: Path) -> None:
        target = tmp_path / "a.csv"
        target.write_text("old")
        with pytest.raises(OutputExistsError, match=r"a\.csv: exists already; .*--overwrite"), atomic_path(target):
            pytest.fail("the block must not run")
        assert target.read_text() == "old"

    def test_refuses_a_target_that_appeared_meanwhile(self, tmp_path: Path) -> None:
        target = tmp_path / "a.csv"
        with pytest.raises(OutputExistsError), atomic_path(target):
            target.write_text("theirs")
        assert names(tmp_path) == ["a.csv"]
        assert target.read_text() == "theirs"

    def test_overwrite_keeps_the_old_until_the_end(self, tmp_path: Path) -> None:
        target = tmp_path / "a.csv"
        target.write_text("old")
        with pytest.raises(ValueError, match="x"), atomic_path(target, overwrite=True):
            raise ValueError("x")
        assert target.read_text() == "old"
        with atomic_path(target, overwrite=True) as temporary:
            temporary.write_text("new")
            assert target.read_text() == "old"
        assert target.read_text() == "new"
        assert names(tmp_path) == ["a.csv"]

    def test_a_dangling_link_is_an_existing_target(self, tmp_path: Path) -> None:
        (tmp_path / "link").symlink_to(tmp_path / "nowhere")
        with pytest.raises(OutputExistsError), atomic_path(tmp_path / "link"):
            pass

    @pytest.mark.parametrize("overwrite", [False, True])
    def test_refuses_folders_and_devices(self, tmp_path: Path, overwrite: bool) -> None:
        with pytest.raises(UsageError, match="is a folder"), atomic_path(tmp_path, overwrite=overwrite):
            pass
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(UsageError, match="no regular"), atomic_path(tmp_path / "pipe", overwrite=overwrite):
            pass

    def test_a_file_as_parent_is_an_output_error(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("x")
        with (
            pytest.raises(OutputError, match=r"cannot be written.*; .*part of the path"),
            atomic_path(tmp_path / "file" / "a.csv"),
        ):
            pass
        assert names(tmp_path) == ["file"]

    def test_a_reader_error_inside_passes(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "a.csv"):
            (tmp_path / "input-that-is-not-there").read_text()
        assert names(tmp_path) == []


class TestFailingDisk:
    def test_a_write_that_does_not_fit(self, tmp_path: Path) -> None:
        with (
            pytest.raises(OutputError, match=r"a\.bin: cannot be written: File too large; ") as caught,
            atomic_path(tmp_path / "new" / "a.bin") as temporary,
            files_of_at_most(4096),
        ):
            temporary.write_bytes(bytes(10_000))
        assert caught.value.exit_code == 1
        assert names(tmp_path) == []

    def test_inside_a_folder_names_the_file_as_it_would_be_called(self, tmp_path: Path) -> None:
        with (
            pytest.raises(OutputError) as caught,
            atomic_folder(tmp_path / "run") as folder,
            atomic_path(folder / "a.bin") as temporary,
            files_of_at_most(4096),
        ):
            temporary.write_bytes(bytes(10_000))
        assert caught.value.file == str(tmp_path / "run" / "a.bin")
        assert names(tmp_path) == []

    @pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES])
    @pytest.mark.parametrize("kind", ["file", "folder"])
    def test_says_why_and_what_to_do(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, kind: str
    ) -> None:
        def fail(path: Path, *_: object, **__: object) -> None:
            raise OSError(code, os.strerror(code), str(path))

        monkeypatch.setattr(Path, "touch" if kind == "file" else "mkdir", fail)
        opened = atomic_path(tmp_path / "a") if kind == "file" else atomic_folder(tmp_path / "a")
        with pytest.raises(OutputError) as caught, opened:
            pytest.fail("the block must not run")
        assert os.strerror(code) in caught.value.reason
        assert caught.value.hint
        assert names(tmp_path) == []

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    def test_a_forbidden_folder(self, tmp_path: Path) -> None:
        tmp_path.chmod(0o500)
        try:
            with pytest.raises(OutputError, match="Permission denied"), atomic_path(tmp_path / "a"):
                pass
        finally:
            tmp_path.chmod(0o700)


class TestFolder:
    def test_appears_whole(self, tmp_path: Path) -> None:
        with atomic_folder(tmp_path / "runs" / "clip") as folder:
            (folder / "sub").mkdir()
            (folder / "sub" / "a").write_text("x")
            assert not (tmp_path / "runs" / "clip").exists()
        assert names(tmp_path) == ["runs", "runs/clip", "runs/clip/sub", "runs/clip/sub/a"]

    def test_an_exception_leaves_nothing(self, tmp_path: Path) -> None:
        with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "runs" / "clip") as folder:
            write_and_fail(folder / "a", KeyboardInterrupt())
        assert names(tmp_path) == []

    def test_an_empty_folder_is_free(self, tmp_path: Path) -> None:
        (tmp_path / "run").mkdir()
        with atomic_folder(tmp_path / "run") as folder:
            (folder / "a").write_text("x")
        assert names(tmp_path) == ["run", "run/a"]

    def test_a_filled_folder_needs_overwrite(self, tmp_path: Path) -> None:
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "run.json").write_text("{}")
        with pytest.raises(OutputExistsError), atomic_folder(tmp_path / "run"):
            pass
        assert names(tmp_path) == ["run", "run/run.json"]

    def test_overwrite_replaces_own_output_at_the_end(self, tmp_path: Path) -> None:
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "run.json").write_text("old")
        with pytest.raises(ValueError, match="x"), atomic_folder(tmp_path / "run", overwrite=True):
            raise ValueError("x")
        assert (tmp_path / "run" / "run.json").read_text() == "old"
        with atomic_folder(tmp_path / "run", overwrite=True) as folder:
            (folder / "new").write_text("x")
            assert (tmp_path / "run" / "run.json").read_text() == "old"
        assert names(tmp_path) == ["run", "run/new"]

    def test_a_failing_swap_puts_the_old_folder_back(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "run.json").write_text("old")
        real = Path.rename
        calls = []

        def fail_second(self: Path, target: Path) -> Path:
            calls.append(self)
            if len(calls) == 2:
                raise OSError(errno.ENOSPC, "full")
            return real(self, target)

        with pytest.raises(OutputError), atomic_folder(tmp_path / "run", overwrite=True):
            monkeypatch.setattr(Path, "rename", fail_second)
        assert names(tmp_path) == ["run", "run/run.json"]
        assert (tmp_path / "run" / "run.json").read_text() == "old"

    def test_never_replaces_files_of_others(self, tmp_path: Path) -> None:
        (tmp_path / "photos").mkdir()
        (tmp_path / "photos" / "me.jpg").write_text("x")
        with pytest.raises(UsageError, match="did not write"), atomic_folder(tmp_path / "photos", overwrite=True):
            pass
        with atomic_folder(tmp_path / "photos", overwrite=True, mark="me.jpg"):
            pass
        assert names(tmp_path) == ["photos"]

    @pytest.mark.parametrize(
        ("name", "mark", "said"),
        [
            ("run.json", "metrics.json", r"holds a run of landtool \(run\.json\), which this command does not replace"),
            ("metrics.json", "run.json", r"holds an evaluation \(metrics\.json\), which"),
            ("manifest.json", "run.json", r"holds a generated dataset \(manifest\.json\), which"),
        ],
    )
    def test_says_what_another_command_wrote(self, name: str, mark: str, said: str, tmp_path: Path) -> None:
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / name).write_text("{}")
        with pytest.raises(UsageError, match=said), atomic_folder(tmp_path / "out", overwrite=True, mark=mark):
            pass
        assert names(tmp_path) == ["out", f"out/{name}"]

    def test_refuses_files_and_the_current_folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "file").write_text("x")
        with pytest.raises(UsageError, match="is a file"), atomic_folder(tmp_path / "file", overwrite=True):
            pass
        monkeypatch.chdir(tmp_path)
        with pytest.raises(UsageError, match="current folder"), atomic_folder(Path(), overwrite=True):
            pass

    def test_follows_a_link_to_a_folder(self, tmp_path: Path) -> None:
        (tmp_path / "big").mkdir()
        (tmp_path / "run").symlink_to(tmp_path / "big")
        with atomic_folder(tmp_path / "run") as folder:
            (folder / "a").write_text("x")
        assert (tmp_path / "run").is_symlink()
        assert (tmp_path / "big" / "a").read_text() == "x"

    def test_everything_reaches_the_disk_before_the_name(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        synced: list[str] = []
        monkeypatch.setattr(atomic, "_sync", lambda path: synced.append(path.name))
        with atomic_folder(tmp_path / "run") as folder:
            (folder / "a").write_text("x")
        assert synced == ["a", folder.name, tmp_path.name]


class TestInputAsOutput:
    def test_other_places_are_fine(self, tmp_path: Path) -> None:
        (tmp_path / "clip.mp4").write_text("x")
        refuse_input_as_output([tmp_path / "clip.mp4"], tmp_path / "clip")
        refuse_input_as_output([tmp_path / "clip.mp4"], tmp_path / "other.mp4")

    def test_same_file_by_name_link_or_hard_link(self, tmp_path: Path) -> None:
        clip = tmp_path / "clip.mp4"
        clip.write_text("x")
        (tmp_path / "soft").symlink_to(clip)
        (tmp_path / "hard").hardlink_to(clip)
        for name in ("clip.mp4", "soft", "hard"):
            with pytest.raises(UsageError, match="input itself"):
                refuse_input_as_output([clip], tmp_path / name)

    def test_inside_an_input_and_around_one(self, tmp_path: Path) -> None:
        (tmp_path / "images").mkdir()
        with pytest.raises(UsageError, match="lies in the input"):
            refuse_input_as_output([tmp_path / "images"], tmp_path / "images" / "out" / "images")
        with pytest.raises(UsageError, match="holds the input"):
            refuse_input_as_output([tmp_path / "images"], tmp_path)


class TestResumable:
    def test_appears_whole_and_leaves_nothing_else(self, tmp_path: Path) -> None:
        with resumable_folder(tmp_path / "new" / "set", "a", mark="m") as work:
            (work.whole / "m").write_text("x")
            (work.notes / "n").write_text("x")
            assert not (tmp_path / "new" / "set").exists()
        assert names(tmp_path) == ["new", "new/set", "new/set/m"]

    def test_the_same_request_goes_on(self, tmp_path: Path) -> None:
        with pytest.raises(KeyboardInterrupt), resumable_folder(tmp_path / "set", "a", mark="m") as work:
            write_and_fail(work.whole / "m", KeyboardInterrupt())
        assert [path.name.startswith(RESUME_PREFIX) for path in tmp_path.iterdir()] == [True]
        with resumable_folder(tmp_path / "set", "a", mark="m") as work:
            assert (work.whole / "m").read_text() == "half"
        assert names(tmp_path) == ["set", "set/m"]

    @pytest.mark.parametrize(("name", "request_text"), [("set", "b"), ("other", "a")])
    def test_another_request_does_not(self, tmp_path: Path, name: str, request_text: str) -> None:
        with pytest.raises(KeyboardInterrupt), resumable_folder(tmp_path / "set", "a", mark="m") as work:
            write_and_fail(work.whole / "m", KeyboardInterrupt())
        with resumable_folder(tmp_path / name, request_text, mark="m") as work:
            assert names(work.whole) == []

    def test_nothing_stays_of_a_run_that_wrote_nothing(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="x"), resumable_folder(tmp_path / "new" / "set", "a", mark="m"):
            raise ValueError("x")
        assert names(tmp_path) == []

    def test_refuses_what_is_there_before_any_work(self, tmp_path: Path) -> None:
        (tmp_path / "set").mkdir()
        (tmp_path / "set" / "m").write_text("old")
        with pytest.raises(OutputExistsError), resumable_folder(tmp_path / "set", "a", mark="m"):
            pytest.fail("the block must not run")
        with pytest.raises(UsageError, match="did not write"):  # noqa: SIM117
            with resumable_folder(tmp_path / "set", "a", mark="other", overwrite=True):
                pytest.fail("the block must not run")
        with resumable_folder(tmp_path / "set", "a", mark="m", overwrite=True) as work:
            (work.whole / "m").write_text("new")
            assert (tmp_path / "set" / "m").read_text() == "old"
        assert (tmp_path / "set" / "m").read_text() == "new"
        assert names(tmp_path) == ["set", "set/m"]

    def test_two_runs_do_not_meet(self, tmp_path: Path) -> None:
        with resumable_folder(tmp_path / "set", "a", mark="m") as work:
            with (
                pytest.raises(UsageError, match="another run is writing the same"),
                resumable_folder(tmp_path / "set", "a", mark="m"),
            ):
                pytest.fail("the block must not run")
            (work.whole / "m").write_text("x")
        assert names(tmp_path) == ["set", "set/m"]

    def test_a_full_disk_is_said_and_keeps_what_fitted(self, tmp_path: Path) -> None:
        with (
            pytest.raises(OutputError, match=r"set: cannot be written: File too large; .*the same call goes on"),
            resumable_folder(tmp_path / "set", "a", mark="m") as work,
        ):
            write_small_and_large(work.whole)
        with resumable_folder(tmp_path / "set", "a", mark="m") as work:
            assert "small" in names(work.whole)


def test_a_folder_of_known_names_is_replaced_and_no_other(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "a.png").write_text("old")
    ours = {"a.png", "b.png"}.issuperset
    with atomic_folder(folder, overwrite=True, mark=ours) as temporary:
        (temporary / "b.png").write_text("new")
    assert names(folder) == ["b.png"]
    (folder / "letter.txt").write_text("mine")
    with (
        pytest.raises(UsageError, match="holds files landtool did not write"),
        atomic_folder(folder, overwrite=True, mark=ours),
    ):
        pass
    assert names(folder) == ["b.png", "letter.txt"]
