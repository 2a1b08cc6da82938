"""Random numbers for errors of sensors: the same for every reading of a step, whatever robots come or go within it."""

from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_number, stream_of
from mesa_swarm.kernels.type_names import Integers, RealRows

# Places in `NoiseArrays.state`; no step.
STEP, COUNT, FITS, NEVER = 0, 1, 2, -1


class NoiseArrays(NamedTuple):
    """Draws for each sensor (n, s), and their stream.

    The state is the step in which numbers were drawn last, how many, and whether `draws` are these.
    """

    draws: RealRows
    state: Integers
    stream: Stream


NO_NOISE = NoiseArrays(np.empty((0, 0)), np.array([NEVER, 0, 0]), Stream(0, 0))


class SensorNoise:
    """The draws of a step for errors of sensors, and the stream that only they are drawn from.

    Attributes
    ----------
    draws : ndarray, shape (n, s)
        Uniform in [0, 1), once they are drawn.
    """

    def __init__(self, generator: np.random.Generator) -> None:
        self.generator = generator
        self.draws = np.empty((0, 0))
        self._former = self.draws
        self._state = np.array([NEVER, 0, 0])

    def arrays_for(self, shape: tuple[int, ...]) -> NoiseArrays:
        """Return what `draw_noise` takes for as many robots and sensors."""
        if self.draws.shape != shape:
            self._former, self.draws = self.last_draws, np.empty(shape)
            self._state[FITS] = False
        return NoiseArrays(self.draws, self._state, stream_of(self.generator))

    def draw(self, step: int, shape: tuple[int, ...]) -> np.ndarray:
        """Return the draws of a step, counted from 0."""
        arrays = self.arrays_for(shape)
        while not draw_noise(arrays, step):
            self.rewind()
        return self.draws

    def rewind(self) -> None:
        """Return to before this step's draws: robots were added or removed since, as if before them."""
        self.generator.bit_generator.advance(-int(self._state[COUNT]))  # type: ignore[attr-defined]  # of PCG64
        self._state[STEP] = NEVER

    @property
    def last_draws(self) -> np.ndarray:
        """The draws of the last step that had some, of the robots that there were."""
        return self.draws if self._state[FITS] else self._former

    def store(self) -> tuple[int, dict[str, Any], np.ndarray] | None:
        """Return the last step with draws, the state of the stream before it, and the draws; None if there is none."""
        if self._state[STEP] == NEVER:
            return None
        before = np.random.PCG64(0)
        before.state = self.generator.bit_generator.state  # type: ignore[assignment]
        before.advance(-int(self._state[COUNT]))
        return int(self._state[STEP]), before.state, self.last_draws.copy()  # type: ignore[return-value]

    def restore(self, step: int, draws: np.ndarray) -> None:
        """Take back a step and its draws, after which the stream stands."""
        self.draws = np.ascontiguousarray(draws)
        self._state[:] = step, draws.size, True


@compiled
def draw_noise(noise, step):
    """Draw the numbers of a step, unless they were drawn; return whether they are of the robots that there are."""
    draws, state = noise.draws, noise.state
    if state[STEP] == step:
        return state[FITS] == 1
    for i in range(draws.shape[0]):
        for s in range(draws.shape[1]):
            draws[i, s] = draw_number(noise.stream)
    state[STEP], state[COUNT], state[FITS] = step, draws.size, 1
    return True
