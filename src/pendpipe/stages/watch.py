"""What a plan sees of files: one `stat` each, and a hash where length or time of change differ.

No program can set a file's time of change (``st_ctime``). What was seen is kept beside Snakemake's
own notes: of a user's file its hash, of a result whether it was sound, and the damages that it has
had. These are a parameter of its rule: a new one makes Snakemake run the rule again, once.
"""

import os
from pathlib import Path
from typing import Any

from pendpipe.files import Damage, damage_of, read_json, sha256, write_json


class Watch:
    """Files as the last plan saw them.

    Parameters
    ----------
    path
        Where it is kept.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: dict[str, Any] = read_json(path)["files"] if path.is_file() else {}
        self.damages: list[Damage] = []

    def sha256(self, path: Path) -> str | None:
        """The hash of a user's file (`files.sha256`)."""
        entry, now = self._entry(str(path))
        if now and entry.get("seen") != now:
            entry |= {"sha256": sha256(path), "seen": now}
        return entry["sha256"] if now else None

    def history(self, *paths: str) -> str:
        """The damages of results: those that are found now, and earlier ones."""
        return " ".join(found for path in paths for found in self._damages(path))

    def _damages(self, path: str) -> list[str]:
        entry, now = self._entry(path)
        had: list[str] = entry.setdefault("damages", [])
        if now and entry.get("seen") != now:
            damage = damage_of(Path(path))
            if damage is None:
                entry["seen"] = now
            else:
                self.damages.append(damage)
                had += [damage.found] * (damage.found not in had)
        return had

    def _entry(self, path: str) -> tuple[dict[str, Any], list[int]]:
        """What is known of a file, and its length and time of change now; none where it is not."""
        try:
            status = os.stat(path)  # noqa: PTH116 (a Path takes longer, and files are many)
        except (OSError, ValueError):
            return self.files.get(path, {}), []
        # On Windows st_ctime is the time of creation, and st_mtime all there is.
        changed = max(status.st_ctime_ns, status.st_mtime_ns)
        return self.files.setdefault(path, {}), [status.st_size, changed]

    def keep(self) -> None:
        """Keep what was seen for the next plan."""
        write_json(self.path, {"schema_version": 1, "files": self.files})
