"""Grounds shared by processes: each is painted by one of them, and read by all out of the same memory."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landtool.synth.grounds.texture import Atlas, GroundTexture

_ATLASES = ("detail", "patches", "grain")
_NUMBERS = ("kind", "tile_m", "patch_tiles", "grain_tile_m", "tint")
# longer than any ground takes: whoever said to paint it is gone
_PATIENCE_S, _LOOK_S = 20.0, 0.02


@dataclass(frozen=True)
class GroundStore:
    """Grounds in a folder, which the processes of one run share."""

    folder: Path

    def claim(self, name: str) -> bool:
        """Return whether this process is the one to paint a ground."""
        try:
            (self.folder / f"{name}.claim").mkdir(parents=True)
        except FileExistsError:
            return False
        return True

    def put(self, name: str, ground: GroundTexture) -> None:
        """Keep a ground; it is there for others when all of it is. Raises OSError when there is no room for it."""
        about: dict[str, object] = {field: getattr(ground, field) for field in _NUMBERS}
        for part in _ATLASES:
            atlas: Atlas = getattr(ground, part)
            content = io.BytesIO()
            np.save(content, atlas.picture)
            self._picture(name, part).write_bytes(content.getbuffer())
            about[part] = {"places": atlas.places.tolist(), "levels": atlas.levels, "mirrored": atlas.mirrored}
        temporary = self.folder / f"{name}.part"
        temporary.write_text(json.dumps(about), encoding="utf-8")
        temporary.replace(self._about(name))

    def get(self, name: str, paint: Callable[[], GroundTexture]) -> GroundTexture:
        """Return a ground; paint it when nobody has, wait when another process does."""
        until = time.monotonic() + _PATIENCE_S
        while not self._about(name).exists():
            if self.claim(name):
                return self._shared(name, paint())
            if time.monotonic() > until:
                return paint()
            time.sleep(_LOOK_S)
        return self._read(name)

    def _shared(self, name: str, ground: GroundTexture) -> GroundTexture:
        """Put a ground and return the shared copy, so that its own is given back; its own where there is no room."""
        try:
            self.put(name, ground)
        except OSError:
            # sharing only saves memory: a full disk is for the pictures to tell
            for part in _ATLASES:
                self._picture(name, part).unlink(missing_ok=True)
            (self.folder / f"{name}.part").unlink(missing_ok=True)
            (self.folder / f"{name}.claim").rmdir()
            return ground
        return self._read(name)

    def _read(self, name: str) -> GroundTexture:
        about = json.loads(self._about(name).read_text(encoding="utf-8"))
        blue, green, red = about.pop("tint")
        detail, patches, grain = (self._atlas(name, part, about.pop(part)) for part in _ATLASES)
        return GroundTexture(detail=detail, patches=patches, grain=grain, tint=(blue, green, red), **about)

    def _atlas(self, name: str, part: str, about: dict[str, Any]) -> Atlas:
        picture = np.asarray(np.load(self._picture(name, part), mmap_mode="r"))
        return Atlas(picture, np.array(about["places"], np.float32), about["levels"], about["mirrored"])

    def _about(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def _picture(self, name: str, part: str) -> Path:
        return self.folder / f"{name}.{part}.npy"
