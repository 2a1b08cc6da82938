"""The diary of an evolution: a file of what it was told, from which it goes on."""

import json
import os
from pathlib import Path

from mesa_swarm.errors import LearningError
from mesa_swarm.experiments.experiment import without_addresses
from mesa_swarm.files import write_whole
from mesa_swarm.learning.evolution import Evolution

FORMAT = "mesa_swarm evolution 1"
LARGEST_FILE = 100_000_000


class Diary:
    """What an evolution was told so far, in a file; without a file, nothing.

    Parameters
    ----------
    file : path, optional
        Ends with .json.
    settings : dict
        Of the evolution: texts and numbers.

    Raises
    ------
    LearningError
        If the name ends otherwise.
    """

    def __init__(self, file: str | os.PathLike[str] | None, settings: dict) -> None:
        self.file = None if file is None else Path(file)
        self.settings = json.loads(json.dumps(settings))
        if self.file is not None and self.file.suffix != ".json":
            raise LearningError(f"{self.file.name} does not end with .json; give the evolution's file such a name")

    def write(self, search: Evolution) -> None:
        """Write all that was told, whole or not at all."""
        if self.file is None:
            return
        text = json.dumps({"format": FORMAT, "settings": self.settings, "fitness": search.told})
        write_whole(self.file, text, LearningError)

    def retell(self, search: Evolution, most: int) -> None:
        """Tell a new search what the file says, if there is one; at most so many generations."""
        if self.file is None or not self.file.exists():
            return
        kept = self._read(self.file)
        changed = sorted(name for name, now in self.settings.items() if not _same(kept["settings"].get(name), now))
        if changed:
            raise LearningError(
                f"{self.file} is of an evolution with other {', '.join(changed)}; use its settings or another file"
            )
        try:
            for told in kept["fitness"][:most]:
                search.tell(told)
        except (TypeError, ValueError):
            raise self._refusal("its fitnesses are not numbers") from None
        except LearningError as error:
            raise self._refusal(str(error)) from None

    def _read(self, file: Path) -> dict:
        try:
            if file.stat().st_size > LARGEST_FILE:
                raise self._refusal(f"it has more than {LARGEST_FILE:,} bytes")
            kept = json.loads(file.read_bytes())
        except OSError as error:
            raise LearningError(f"{self.file} cannot be read: {error.strerror or error}") from None
        except (ValueError, RecursionError):
            raise self._refusal("it is not JSON") from None
        if not isinstance(kept, dict) or kept.get("format") != FORMAT:
            raise self._refusal(f"its format is not {FORMAT!r}")
        if not isinstance(kept.get("settings"), dict) or not isinstance(kept.get("fitness"), list):
            raise self._refusal("it has no settings or no fitness")
        return kept

    def _refusal(self, why: str) -> LearningError:
        return LearningError(f"{self.file} is no evolution that can be gone on with: {why}")


def _same(kept: object, now: object) -> bool:
    """Return whether a setting is what it was; older files name places in memory, which were others each time."""
    return now == (without_addresses(kept) if isinstance(kept, str) else kept)
