"""Designs and their devices as stored in recordings, by the names of their classes."""

import subprocess
import sys

import pytest

import mesa_swarm
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.recording.stored_values import part_from_json, part_to_json
from mesa_swarm.robots.devices import Device
from mesa_swarm.robots.drive import DifferentialDrive, EqualByValues

PUBLISHED = [getattr(mesa_swarm, name) for name in mesa_swarm.__all__]
DEVICES = [
    kind
    for kind in PUBLISHED
    if isinstance(kind, type) and issubclass(kind, (Device, EqualByValues)) and hasattr(kind, "__dataclass_fields__")
]


class Geared(DifferentialDrive):
    """A drive of a user."""


@pytest.mark.parametrize("kind", DEVICES)
def test_every_published_device_and_drive_is_stored_by_its_name_without_being_listed(kind):
    device = kind(**({"field": "trail"} if kind.__name__ in ("Emitter", "FieldSensor") else {}))
    stored = part_to_json(device)
    assert list(stored) == [kind.__name__]
    assert part_from_json(stored) == device


def test_a_drive_of_a_user_is_refused_and_none_is_made_by_its_name():
    with pytest.raises(RecordingError, match="of class Geared, which cannot be recorded"):
        part_to_json(Geared())
    with pytest.raises(RecordingError, match="unknown part 'Geared'"):
        part_from_json({"Geared": {"acceleration": None}})


def test_a_device_that_nothing_has_used_yet_is_read():
    program = (
        "from mesa_swarm.recording.stored_values import part_from_json; print(part_from_json({'Gripper': {}}).reach)"
    )
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "3.0\n"
