"""What a path on the command line or in a settings file must be: something plain, on this machine, that is there."""

from __future__ import annotations

import difflib
import stat
from pathlib import Path

from landtool.errors import UsageError

_NEAR = 0.65  # of difflib's likeness: one letter of three may be wrong, two of four are another name
_SPELLING = 0.8


def local_path(path: Path | str) -> Path:
    """Return the path of an existing plain file or folder.

    Raises UsageError for a URL, for what is not there, naming the nearest name that is, and for pipes and devices,
    which can be read once only or never end.
    """
    text = str(path)
    local = Path(path)
    scheme, colon, rest = text.partition(":")
    if colon and scheme.isidentifier() and len(scheme) > 1 and (rest.startswith("/") or not local.exists()):
        # pathlib folds "//", so a URL that went through Path still shows as "scheme:/host"
        url = f"{scheme}:/{rest}" if rest.startswith("/") and not rest.startswith("//") else text
        raise UsageError("is no local file", file=url, hint="download the recording first and give its path")
    try:
        mode = local.stat().st_mode
    except FileNotFoundError:
        reason = "is a link to nothing" if local.is_symlink() else "does not exist"
        raise UsageError(reason, file=text, hint=nearest(local)) from None
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise UsageError(f"cannot be opened ({said})", file=text, hint="check the path and its permissions") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UsageError("is no plain file or folder", file=text, hint="save what it gives to a file first")
    return local


def local_file(path: Path | str) -> Path:
    """Return the path of an existing plain file. Raises UsageError as `local_path` does, and for a folder."""
    local = local_path(path)
    if local.is_dir():
        raise UsageError("is a folder", file=path, hint="give the file itself")
    return local


def nearest(path: Path) -> str:
    """Return a hint for a path that is not there: a name beside it that is nearly the same, else where to look."""
    folder = path.parent
    if not folder.is_dir():
        return f"there is no folder {folder}"
    try:
        entries = sorted(entry for entry in folder.iterdir() if _same_kind(path, entry))
    except OSError:
        return f"check the permissions of {folder}"
    # compared without their suffixes, which make all names of a kind alike
    names = {entry.stem: entry.name for entry in entries if entry.name != path.name}
    close = difflib.get_close_matches(path.stem, names, n=1, cutoff=_NEAR)
    return f"did you mean {folder / names[close[0]]}?" if close else f"check the names in {folder}"


def _same_kind(missing: Path, there: Path) -> bool:
    """Whether an ending is the same or spelt otherwise, as .yml for .yaml; one left out is that of the same name."""
    if not missing.suffix and there.suffix:
        return missing.name == there.stem
    ends = missing.suffix.lower(), there.suffix.lower()
    return ends[0] == ends[1] or difflib.SequenceMatcher(None, *ends).ratio() >= _SPELLING
