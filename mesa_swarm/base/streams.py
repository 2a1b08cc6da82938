"""Random streams: one for each subsystem, all from the model's seed, none disturbed by another."""

from collections.abc import Mapping
from typing import Any
from zlib import crc32

import numpy as np

__all__ = ["Seed", "Streams"]

# What a model takes as its `rng`.
Seed = int | np.integer | np.random.SeedSequence | np.random.Generator | np.random.BitGenerator | None


class Streams:
    """Independent generators by name.

    Each name has a stream of its own: adding a sensor does not change the walk, and two strategies have the same
    start and the same noise.
    """

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self.seed = seed
        self._streams: dict[str, np.random.Generator] = {}

    def __getitem__(self, name: str) -> np.random.Generator:
        """Return the stream of this name, always the same one."""
        if name not in self._streams:
            key = (*self.seed.spawn_key, crc32(name.encode()))
            child = np.random.SeedSequence(self.seed.entropy, spawn_key=key)
            self._streams[name] = np.random.Generator(np.random.PCG64(child))
        return self._streams[name]

    def name_of(self, generator: np.random.Generator) -> str | None:
        """Return the name of a stream, None if the generator is not one of these."""
        return next((name for name, stream in self._streams.items() if stream is generator), None)

    def items(self) -> list[tuple[str, np.random.Generator]]:
        """Return the streams that were used, by name."""
        return sorted(self._streams.items())

    def state(self) -> dict[str, Mapping[str, Any]]:
        """Return the state of every stream that was used, by name."""
        return {name: stream.bit_generator.state for name, stream in sorted(self._streams.items())}
