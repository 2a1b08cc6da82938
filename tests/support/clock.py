"""A clock for what is played: nothing but waiting takes time, so that pace is exact on any machine."""

from mesa_swarm.viewing.play_loop import PlayLoop
from support.waiting import threads, wait_until


class Clock:
    """Time that passes only while the program waits, and where a test lets it."""

    def __init__(self, now=0.0):
        self.now, self.longest = now, 0.0

    def __call__(self):
        return self.now

    def wait(self, stop, seconds):
        self.now, self.longest = self.now + seconds, max(self.longest, seconds)
        return stop.is_set()

    def loop(self, step, show=lambda: None, ended=lambda: None, speed=60.0):
        """Return a loop that goes by this clock."""
        loop = PlayLoop(step, show, ended, clock=self, wait=self.wait)
        loop.speed = speed
        return loop

    def times(self, number, step=lambda stop: True, show=lambda: None, speed=60.0):
        """Play a number of steps, and return the times at which they were taken."""
        times = []

        def noted(stop):
            times.append(self.now)
            return step(stop) and len(times) < number

        self.loop(noted, show, speed=speed).play()
        wait_until(lambda: len(times) == number and not threads("play"))
        return times
