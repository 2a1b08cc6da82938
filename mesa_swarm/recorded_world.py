"""RecordedWorld: the doors to recordings, which are built on the floors above."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self

from mesa_swarm.errors import SwarmError
from mesa_swarm.observed_world import ObservedWorld

if TYPE_CHECKING:  # floors above
    from mesa_swarm.dashboard.canvas_widget import SwarmCanvas
    from mesa_swarm.recording.recorder import Recorder
    from mesa_swarm.recording.verify import Verification


class RecordedWorld(ObservedWorld):
    """A world that can be written to a file and taken up again; `SwarmModel` makes it step."""

    def record(
        self,
        path: str | os.PathLike[str],
        *,
        every: int = 1,
        columns: Sequence[str] | None = None,
        exact: bool = False,
        overwrite: bool = False,
        rerun: bool = True,
        checkpoint_every: int = 1000,
    ) -> "Recorder":
        """Write the model after each of the next steps to a file; see `mesa_swarm.recording.record`.

        Parameters
        ----------
        path : str or Path
        every : int
            Steps from one row to the next.
        columns : sequence of str, optional
            Of the swarm, and "fires", "contacts", "loads"; by default what one needs to look at the run.
        exact : bool
            Whether real numbers keep all 64 bits.
        overwrite : bool
            Whether a file that is there is replaced.
        rerun : bool
            Whether the model must be one that can be run again from what the file says of it.
        checkpoint_every : int
            Steps from one checkpoint, from which `resume` goes on, to the next; 0 stores none.

        Returns
        -------
        Recorder

        Examples
        --------
        >>> import tempfile
        >>> from mesa_swarm import SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> with tempfile.TemporaryDirectory() as folder, model.record(f"{folder}/run.arrow", every=5) as recorder:
        ...     len(model.run(20) and recorder)
        4
        """
        from mesa_swarm.recording.recorder import record  # noqa: PLC0415 - a floor above, and slow to load

        return record(
            self,
            path,
            every=every,
            columns=columns,
            exact=exact,
            overwrite=overwrite,
            rerun=rerun,
            checkpoint_every=checkpoint_every,
        )

    @classmethod
    def resume(
        cls, path: str | os.PathLike[str], *, step: int | None = None, progress: bool = False, **changes: object
    ) -> Self:
        """Return the model as it was after a step of a recording; see `mesa_swarm.recording.resume`.

        Parameters
        ----------
        path : str or Path
        step : int, optional
            By default the last one recorded.
        progress : bool
            Whether to show a bar of the steps that are run again.
        **changes
            Parameters of the model that are other from then on.

        Returns
        -------
        ObservedWorld
            Of this class. At a step after which something was changed by hand, with that change.
        """
        from mesa_swarm.recording.resume import resume  # noqa: PLC0415 - a floor above, and slow to load

        return resume(cls, path, step=step, progress=progress, **changes)

    @classmethod
    def verify(cls, path: str | os.PathLike[str], *, progress: bool = False) -> "Verification":
        """Run a recorded model again and compare every row; see `mesa_swarm.recording.verify`.

        Parameters
        ----------
        path : str or Path
            Of a recording of this class, or of one that is derived from it.
        progress : bool
            Whether to show a bar.

        Returns
        -------
        Verification
        """
        from mesa_swarm.recording.recording import Recording  # noqa: PLC0415 - floors above, and slow to load
        from mesa_swarm.recording.resume import class_of  # noqa: PLC0415
        from mesa_swarm.recording.verify import verify  # noqa: PLC0415

        recording = Recording(path)
        return verify(recording, class_of(recording, cls), progress)

    def show(self, *, speed: float = 60.0, height: int = 560) -> "SwarmCanvas":
        """Return a widget for notebooks on which the model is seen and played; needs the extra `dashboard`.

        What a program steps is shown as well. Where no widget can live, there is a picture instead.

        Parameters
        ----------
        speed : float
            Steps a second when it is played, above 0, at most 1000.
        height : int
            Of the widget, 100 to 10,000 pixels.

        Returns
        -------
        SwarmCanvas

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> type(SwarmModel(rng=1).show()).__name__
        'SwarmCanvas'
        """
        try:
            from mesa_swarm.dashboard.notebook import show  # noqa: PLC0415 - a floor above, and optional
        except ModuleNotFoundError as error:
            raise SwarmError(
                f"show needs {error.name}; install it with: pip install 'mesa-swarm[dashboard]'"
            ) from error
        return show(self, speed=speed, height=height)

    @contextmanager
    def _observed_run(self) -> Iterator[None]:
        """Tell observers when a run is over; close them if an error or Ctrl-C ends it: what was recorded is kept."""
        begin = self.completed
        try:
            yield
        except BaseException:
            for observer in list(self.observers):
                getattr(observer, "break_off", observer.close)()
            raise
        for observer in list(self.observers):
            if hasattr(observer, "after_run"):
                observer.after_run(self, self.completed - begin)
