import json

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RecordingError
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, recorder
from mesa_swarm.recording import provenance as written
from mesa_swarm.viewing.replay_page import Reel, _in_words
from support.unpacking import unpacked_chunk


def steps_of(reel):
    world = reel.about["world"]
    return [step for place in range(reel.chunks) for step, _ in unpacked_chunk(reel.chunk(place), world)]


def test_chunks_asked_for_in_any_order_are_those_of_playing_from_the_start(fires):
    played = [Reel(Recording(fires)).chunk(place) for place in range(2)]
    sought = Reel(Recording(fires))
    assert [sought.chunk(1), sought.chunk(0)] == played[::-1]
    assert steps_of(sought) == list(range(1, 301))
    for wrong in (-1, 2):
        with pytest.raises(InvalidValueError, match="expected 0 to 1"):
            sought.chunk(wrong)


def test_the_inputs_of_the_player_are_json_and_name_the_origin_of_the_run(fires):
    about = json.loads(json.dumps(Reel(Recording(fires)).about, allow_nan=False))
    assert (about["model"], about["seed"], about["first"], about["rows"]) == ("FireFighting", "5", 1, 300)
    assert about["parameters"]["communication"] == "goal"
    assert about["world"]["layers"] == ["Avoid", "FightFire", "Respond", "Explore"]
    assert about["notes"] == []
    assert [_in_words(value) for value in (0.1 + 0.2, {"entropy": 3, "spawn_key": []})] == [
        "0.3",
        "{'entropy': 3, 'spawn_key': []}",
    ]


def test_events_are_those_of_the_recording(fires):
    listed = [(event["step"], event["kind"], event["text"]) for event in Reel(Recording(fires)).events]
    assert listed == [(event.step, event.kind, event.text) for event in Recording(fires).events()]
    assert listed


def test_of_a_torn_recording_the_whole_part_plays_with_a_note(fires, tmp_path):
    torn = tmp_path / "torn.arrow"
    torn.write_bytes(fires.read_bytes()[:-3000])
    reel = Reel(Recording(torn))
    assert steps_of(reel) == list(range(1, 257))
    assert reel.about["notes"] == ["The recording was not closed; it is whole up to step 256."]


def test_of_a_damaged_recording_the_part_before_the_damage_plays(fires, tmp_path):
    damaged, content = tmp_path / "damaged.arrow", bytearray(fires.read_bytes())
    content[-5000] ^= 1
    damaged.write_bytes(content)
    reel = Reel(Recording(damaged))
    assert steps_of(reel) == list(range(1, 257))
    (note,) = reel.about["notes"]
    assert note.startswith("The recording is damaged after step 256: 256 rows are whole, the rest is not read")
    assert 0 < max(event["step"] for event in reel.events) <= 256


def test_of_a_recording_that_is_damaged_in_the_middle_the_page_names_what_is_left_out(tmp_path):
    path = tmp_path / "damaged.arrow"
    model = FireFighting(n_robots=3, rng=5)
    with model.record(path):
        model.run(800)
    content = bytearray(path.read_bytes())
    content[len(content) * 3 // 5] ^= 1  # in the second of four chunks
    path.write_bytes(content)
    reel = Reel(Recording(path))
    assert steps_of(reel) == list(range(1, 257))
    assert reel.recording.complete
    assert reel.about["notes"] == ["The recording is damaged after step 256; what follows is left out."]


def test_recordings_of_older_versions_are_drawn_without_what_they_lack(transport, tmp_path, monkeypatch):
    monkeypatch.setattr(written, "scenery_of", lambda model: {})
    monkeypatch.setattr(recorder, "_check_readable", lambda schema: None)  # older versions had no such check
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT9, 3)
    with model.record(tmp_path / "old.arrow"):
        model.run(5)
    reel = Reel(Recording(tmp_path / "old.arrow"))
    world = reel.about["world"]
    assert len(world["shapes"]) == len(model.map.obstacles)
    assert (world["designs"][0]["radius"], world["designs"][0]["sensors"]) == (5.0, [])
    assert "An older version" in reel.about["notes"][0]
    assert steps_of(reel) == [1, 2, 3, 4, 5]


def test_columns_that_were_not_recorded_are_not_drawn_and_without_positions_nothing_is(tmp_path):
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT9, 3)
    with (
        model.record(tmp_path / "few.arrow", columns=("position",)),
        model.record(tmp_path / "none.arrow", columns=("heading",)),
    ):
        model.run(5)
    reel = Reel(Recording(tmp_path / "few.arrow"))
    names = {column["name"] for column in reel.about["world"]["columns"]}
    assert names == {"ids", "pose", "design", "fires", "loads", "contacts"}
    (_, columns), *_ = unpacked_chunk(reel.chunk(0), reel.about["world"])
    assert (columns["pose"][:, 2] == 0).all()
    with pytest.raises(RecordingError, match="no positions to draw"):
        Reel(Recording(tmp_path / "none.arrow")).chunk(0)


def test_an_empty_recording_has_no_chunks(tmp_path):
    SwarmModel(rng=1).record(tmp_path / "run.arrow").close()
    reel = Reel(Recording(tmp_path / "run.arrow"))
    assert (reel.rows, reel.chunks, reel.events, reel.about["rows"]) == (0, 0, [], 0)


def test_robots_that_come_and_go_are_drawn_while_they_are_there(tmp_path):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 2)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
        model.add_robots(AGENT9, 1)
        model.run(3)
        model.robots[0].remove()
        model.run(2)
    reel = Reel(Recording(tmp_path / "run.arrow"))
    counts = [len(columns["ids"]) for _, columns in unpacked_chunk(reel.chunk(0), reel.about["world"])]
    assert counts == [2] * 4 + [3] * 3 + [2] * 2


def test_a_world_with_a_load_describes_the_load(transport):
    reel = Reel(Recording(transport))
    world = reel.about["world"]
    (load,) = world["loads"]
    np.testing.assert_allclose(np.abs(load["rings"][0]), 25.0)
    assert any(shape.get("mark") for shape in world["shapes"])


def test_the_player_knows_from_which_step_on_obstacles_differ(tmp_path):
    model = FireFighting(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
        model.add_obstacle(disc((300, 300), 20))
        model.run(4)
        model.control = Subsumption(Explore())
        model.run(4)
    about = json.loads(json.dumps(Reel(Recording(tmp_path / "run.arrow")).about, allow_nan=False))
    assert [later["step"] for later in about["later"]] == [5, 9]
    assert [len(world["shapes"]) - len(about["world"]["shapes"]) for world in about["later"]] == [1, 1]
    assert about["later"][1]["layers"] == ["Explore"]
