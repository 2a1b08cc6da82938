"""The pictures of a run that one can go back to, in memory as many as there is room for."""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass, field

MOST_BYTES = 48_000_000
# What a picture takes besides its frame: itself, its readings, its fingerprint.
PICTURE_BYTES = 1000
# Of a world, for each letter that it is written with.
WORLD_BYTES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """What is shown of a step: a packed frame, the world that it is drawn in, numbers beside it."""

    step: int
    frame: bytes
    world: dict = field(default_factory=dict, repr=False)
    readings: tuple[tuple[str, str], ...] = ()
    fingerprint: str = ""


class Past(ABC):
    """Pictures in the order of time, and the one that is looked at.

    Attributes
    ----------
    index : int
        Of the picture that is looked at.
    """

    def __init__(self) -> None:
        self.index = 0

    @abstractmethod
    def __len__(self) -> int:
        """How many there are."""

    @property
    @abstractmethod
    def shown(self) -> Picture | None:
        """The picture that is looked at, None if there are none."""

    @property
    @abstractmethod
    def first_step(self) -> int:
        """The step of the earliest picture, 0 if there is none."""

    @property
    @abstractmethod
    def last_step(self) -> int:
        """The step of the latest picture, 0 if there is none."""

    @abstractmethod
    def clear(self) -> None:
        """Forget everything."""

    @property
    def is_present(self) -> bool:
        """Whether the picture that is looked at is the latest."""
        return self.index >= len(self) - 1

    def look(self, index: int) -> None:
        """Look at the picture with this index, the nearest one if there is none."""
        self.index = min(max(index, 0), max(len(self) - 1, 0))


class KeptPast(Past):
    """The last pictures of a run, in memory.

    Parameters
    ----------
    most_bytes : int
        The oldest go when they take more than this, with the worlds that they are drawn in; the last two always stay.

    Examples
    --------
    >>> past = KeptPast()
    >>> for step in range(3):
    ...     past.append(Picture(step, b""))
    >>> past.look(past.index - 1)
    >>> past.shown.step, past.is_present
    (1, False)
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        super().__init__()
        self.most_bytes = most_bytes
        self._pictures: deque[Picture] = deque()
        self._sizes: deque[int] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._pictures)

    @property
    def shown(self) -> Picture | None:
        """The picture that is looked at, None before the first."""
        return self._pictures[self.index] if self._pictures else None

    @property
    def first_step(self) -> int:
        """The step of the earliest picture, 0 if there is none."""
        return self._pictures[0].step if self._pictures else 0

    @property
    def last_step(self) -> int:
        """The step of the latest picture, 0 if there is none."""
        return self._pictures[-1].step if self._pictures else 0

    def append(self, picture: Picture) -> None:
        """Keep a new picture, and look at it; it replaces one of the same step."""
        if self._pictures and self._pictures[-1].step == picture.step:
            self._pictures.pop()
            self._bytes -= self._sizes.pop()
        size = PICTURE_BYTES + len(picture.frame) + self._size_of_world(picture)
        self._pictures.append(picture)
        self._sizes.append(size)
        self._bytes += size
        while self._bytes > self.most_bytes and len(self._pictures) > 2:
            self._pictures.popleft()
            self._bytes -= self._sizes.popleft()
        self.index = len(self._pictures) - 1

    def _size_of_world(self, picture: Picture) -> int:
        """Return about how much memory a world takes that the picture before was not drawn in."""
        if self._pictures and self._pictures[-1].world is picture.world:
            return 0
        return WORLD_BYTES * len(repr(picture.world))

    def look_at(self, step: int) -> None:
        """Look at the latest picture that is not of a later step, the first if there is none."""
        self.look(bisect_right(self._pictures, step, key=lambda picture: picture.step) - 1)

    def step_after(self) -> int:
        """Return the step of the picture after the one that is looked at, of the last if there is none."""
        return self._pictures[min(self.index + 1, len(self) - 1)].step

    def clear(self) -> None:
        """Forget everything."""
        self._pictures.clear()
        self._sizes.clear()
        self._bytes = self.index = 0
