"""Films: H.264 in MP4 by the ffmpeg that imageio-ffmpeg brings along."""

import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, cast

import numpy as np

from mesa_swarm.errors import ExportError, InvalidValueError
from mesa_swarm.exports.look import Look
from mesa_swarm.exports.portraits import Portraits
from mesa_swarm.exports.screen import Screen, film_frames
from mesa_swarm.files import draft_of

# yuv420p is the one that every player shows; faststart lets browsers begin before all is loaded.
ENCODING = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p"]
CONTAINER = ["-movflags", "+faststart", "-f", "mp4"]


def export_film(
    portraits: Portraits, path: Path, steps: Sequence[int], *, fps: float, look: Look, progress: bool
) -> None:
    """Write steps as a film, whole or not at all.

    Parameters
    ----------
    portraits : Portraits
    path : Path
    steps : sequence of int
        One a frame.
    fps : float
        Frames a second.
    look : Look
        Its size must be even.
    progress : bool
        Whether to show a bar.

    Raises
    ------
    InvalidValueError
        If the size is odd, or imageio-ffmpeg is missing.
    ExportError
        If ffmpeg fails.
    """
    program = ffmpeg()
    check_even(look)
    screen = Screen(portraits, look)
    with draft_of(path, ExportError) as draft:
        command = [program, "-y", "-v", "error", *_input(screen.size, fps), *ENCODING, *CONTAINER, str(draft)]
        _encode(command, film_frames(screen, steps, progress), path)


def ffmpeg() -> str:
    """Return the program, or say how to get it."""
    try:
        import imageio_ffmpeg  # noqa: PLC0415 - an extra, which only films need

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ModuleNotFoundError, RuntimeError):
        raise InvalidValueError(
            "films need imageio-ffmpeg; install it with: pip install 'mesa-swarm[video]', or export a .gif"
        ) from None


def check_even(look: Look) -> None:
    """Refuse sizes that H.264 cannot have."""
    if look.size is not None and any(length % 2 for length in look.size):
        width, height = look.size
        raise InvalidValueError(f"size is {width}x{height}; films need an even width and height")


def _input(size: tuple[int, int], fps: float) -> list[str]:
    return ["-f", "rawvideo", "-pix_fmt", "rgba", "-s", "{}x{}".format(*size), "-r", f"{fps:g}", "-i", "-"]


def _encode(command: list[str], frames: Iterable[np.ndarray], path: Path) -> None:
    """Send frames to the program and wait for it; Ctrl-C reaches us and not it, so that we may tidy up."""
    with TemporaryFile() as complaints:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=complaints, start_new_session=True)
        try:
            _send(cast(IO[bytes], process.stdin), frames)  # which is a pipe
            status = process.wait()
        finally:
            process.kill()
            process.wait()
        if status:
            complaints.seek(0)
            reason = complaints.read(2000).decode(errors="replace").strip().splitlines() or [f"status {status}"]
            raise ExportError(f"{path} cannot be written: ffmpeg says: {reason[-1]:.200}")


def _send(pipe: IO[bytes], frames: Iterable[np.ndarray]) -> None:
    try:
        with pipe:
            for pixels in frames:
                pipe.write(pixels.data)
    except BrokenPipeError:  # it has ended, and its status says why
        return
