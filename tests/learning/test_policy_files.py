"""Policies in files: kept, gone on with, shared; wrong and hostile files are refused in one line."""

import io
import json
import pickle
import zipfile

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError, LearningError, SwarmError
from mesa_swarm.learning import (
    QLearning,
    QPolicy,
    load_policy,
    policy_files,
    save_policy,
)
from mesa_swarm.robots.design import MOST_SENSORS
from support.q_learners import driven, learned, trained


@pytest.fixture
def file(policy, tmp_path):
    return save_policy(policy, tmp_path / "mine.npz")


def same_policy(one, other):
    weights = zip(one.networks.weights, other.networks.weights, strict=True)
    fields = [(policy.sensors, policy.steps, policy.settings()) for policy in (one, other)]
    return all((a == b).all() for a, b in weights) and fields[0] == fields[1]


def test_a_file_gives_back_all_of_it(policy, file):
    again = load_policy(file)
    assert same_policy(again, policy)
    assert policy.training.items() <= again.training.items()
    assert [path.name for path in file.parent.iterdir()] == ["mine.npz"]


def test_learning_goes_on_where_a_saved_policy_left_off(policy, file):
    model = driven(QLearning(start=load_policy(file)))
    again = learned(model)
    assert all((a == b).all() for a, b in zip(again.networks.weights, policy.networks.weights, strict=True))
    assert learned(model.run(11)).steps == policy.steps + 3 * 10


def test_numpys_numbers_among_the_figures_are_kept_as_numbers(tmp_path):
    figures = {
        "seen": np.int64(3),
        "share": np.float32(0.5),
        "good": np.True_,
        "long": np.longdouble(2),
        "name": np.str_("Ada"),
    }
    policy = learned(trained(steps=2), **figures)
    kept = load_policy(save_policy(policy, tmp_path / "a.npz")).training
    assert {"seen": 3, "share": 0.5, "good": True, "long": 2.0}.items() <= kept.items()


FIGURES = [np.float32("nan"), np.datetime64("2020-01-01"), np.complex64(1), np.clongdouble(1), np.zeros(3)]


@pytest.mark.parametrize("figure", FIGURES)
def test_figures_that_json_does_not_know_are_refused(tmp_path, figure):
    with pytest.raises(LearningError, match="may only hold texts and finite numbers"):
        save_policy(learned(trained(steps=2), figure=figure), tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())


def test_what_is_no_path_is_refused(policy):
    for wrong in (lambda: save_policy(policy, 5), lambda: load_policy(None)):
        with pytest.raises(InvalidValueError, match=r"^path is .*; expected a text or Path"):
            wrong()


@pytest.mark.parametrize("policy", ["x", QPolicy, None])
def test_what_is_no_policy_cannot_be_saved(tmp_path, policy):
    with pytest.raises(InvalidValueError, match=r"^policy is .*; expected a policy such as from load_policy\(\)"):
        save_policy(policy, tmp_path / "a.npz")


def remade(file, **changes):
    """Write the file again with some of its arrays or the header changed; None leaves one out."""
    with np.load(file) as found:
        arrays = {name: found[name] for name in found.files}
    header = json.loads(arrays["header"].tobytes())
    for name, value in changes.items():
        if name in header:
            header[name] = value
        else:
            arrays[name] = value
    if "header" not in changes:
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})


def refused(file):
    with pytest.raises(LearningError) as caught:
        load_policy(file)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 1000
    return message


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "format"),
        ({"family": "tea"}, "'tea'; known: q, reflex, wires"),
        ({"family": ["q"]}, "family"),
        ({"sensors": {"bearings": [0]}}, "incomplete"),
        ({"sensors": None}, "incomplete"),
        ({"sensors": {"bearings": [0], "ranges": [1, 2], "fields_of_view": [1]}}, "differ in number"),
        ({"sensors": {"bearings": [0], "ranges": [1], "fields_of_view": [1]}}, "expected 1 inputs"),
        ({"steps": -1}, "steps is -1"),
        ({"training": 5}, "incomplete"),
        ({"settings": {"actions": 8}}, "a q policy has no encoding; expected inner, inner_bias, outer, outer_bias, "),
        ({"settings": {"actions": 8, "encoding": "distance", "temperature": 1, "hold": 2}}, "has unknown 'hold'"),
        ({"temperature": np.zeros(3)}, "a q policy has a part twice"),
        ({"settings": {"actions": 7, "encoding": "distance", "temperature": 1}}, "actions is 7"),
        ({"settings": {"actions": 8, "encoding": "distance", "temperature": 0}}, "temperature is 0"),
        ({"settings": {"actions": 8, "encoding": "distance", "temperature": "hot"}}, "temperature is 'hot'"),
        ({"settings": {"actions": 8, "encoding": [], "temperature": 1}}, "encoding"),
        ({"outer": None}, "a q policy has no outer;"),
        ({"outer": np.zeros(3)}, "outer is an array of float64, shape (3,)"),
        ({"outer": np.full((24, 18), np.nan)}, "finite"),
        ({"outer": np.zeros((24, 18), complex)}, "finite float64 numbers"),
        ({"outer": np.array(["a"])}, "finite float64 numbers"),
        ({"outer": np.zeros((24, 18), np.float32)}, "its 'outer' holds other values than finite float64 numbers"),
        ({"outer": np.zeros((24, 18), np.int64)}, "its 'outer' holds other values than finite float64 numbers"),
        ({"header": None}, "no header"),
        ({"header": np.zeros(3)}, "no header"),
        ({"header": np.frombuffer(b"[" * 10_000, np.uint8)}, "not JSON"),
        ({"header": np.frombuffer(b"[1]", np.uint8)}, "format"),
    ],
)
def test_a_changed_file_is_refused_in_one_line(file, changes, message):
    remade(file, **changes)
    assert message in refused(file)


def test_what_is_no_file_or_no_archive_is_refused(tmp_path):
    assert "there is no policy" in refused(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("a policy, honestly")
    assert "damaged" in refused(tmp_path / "text.npz")
    assert "cannot be read" in refused(tmp_path)


class Bomb:
    """Something that would run when unpickled."""

    def __reduce__(self):
        return print, ("unpickled",)


def test_pickles_are_never_loaded(file, capsys):
    np.savez(file, header=np.array([Bomb()], dtype=object))
    refused(file)
    file.write_bytes(pickle.dumps(Bomb()))
    refused(file)
    assert capsys.readouterr().out == ""


def test_any_flipped_byte_or_cut_is_refused_or_changes_nothing(file):
    whole, kept = file.read_bytes(), load_policy(file)
    rng = np.random.default_rng(1)
    for place in rng.integers(0, len(whole), 60):
        file.write_bytes(whole[:place])
        refused(file)
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            again = load_policy(file)
        except SwarmError as error:
            assert "\n" not in str(error)
        else:
            assert same_policy(again, kept)
            assert again.training == kept.training


def test_members_of_one_name_twice_are_refused(file):
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(file, "a") as archive:
        archive.writestr("outer.npy", buffer.getvalue())
    assert "two arrays of the same name" in refused(file)


def test_the_largest_policy_of_noise_that_is_saved_can_be_loaded(policy, tmp_path, monkeypatch):
    size = sum(array.nbytes for array in policy.arrays().values())
    monkeypatch.setattr(policy_files, "LARGEST_BYTES", size + size // 100 + 5000)
    monkeypatch.setattr(policy_files, "LARGEST_SAVED", size + 5000)
    assert same_policy(load_policy(save_policy(policy, tmp_path / "mine.npz")), policy)


def test_weights_that_are_not_finite_are_not_saved(policy, tmp_path):
    policy.networks.weights[0][...] = np.nan
    with pytest.raises(LearningError, match="not finite"):
        save_policy(policy, tmp_path / "mine.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["mine.txt", "no/such/folder/mine.npz"])
def test_a_file_that_cannot_be_written_is_refused(policy, tmp_path, name):
    with pytest.raises(LearningError) as caught:
        save_policy(policy, tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_policy_of_just_the_largest_size_is_saved_and_loaded_and_one_byte_more_is_not(policy, tmp_path, monkeypatch):
    path = save_policy(policy, tmp_path / "mine.npz")
    with np.load(path) as found:
        header, size = found["header"].nbytes, sum(found[name].nbytes for name in found.files)
    with zipfile.ZipFile(path) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
    for name, most, words in (("LARGEST_SAVED", size, "of a file"), ("LONGEST_HEADER", header, "as JSON")):
        with monkeypatch.context() as patched:
            patched.setattr(policy_files, name, most)
            assert same_policy(load_policy(save_policy(policy, path)), policy)
            patched.setattr(policy_files, name, most - 1)
            with pytest.raises(LearningError, match=words):
                save_policy(policy, path)
    for name, most, words in (("LARGEST_BYTES", unpacked, "unpacks to"), ("LONGEST_HEADER", header, "no header")):
        with monkeypatch.context() as patched:
            patched.setattr(policy_files, name, most)
            assert same_policy(load_policy(path), policy)
            patched.setattr(policy_files, name, most - 1)
            assert words in refused(path)


def test_a_file_of_just_the_largest_size_is_read_and_one_byte_more_is_not(file, monkeypatch):
    size = file.stat().st_size
    unpacking = "more than 64 arrays"  # of a smaller archive, whose contents are larger than the file
    for most, message in ((size, unpacking), (size - 1, r"unpacks to more than 0 MB")):
        monkeypatch.setattr(policy_files, "LARGEST_BYTES", most)
        assert message in refused(file)


def test_a_list_of_contents_of_just_the_longest_length_is_read_and_one_byte_more_is_not(file, policy, monkeypatch):
    length = policy_files.END.unpack(file.read_bytes()[-policy_files.END.size :])[5]
    monkeypatch.setattr(policy_files, "LARGEST_LIST", length)
    assert same_policy(load_policy(file), policy)
    monkeypatch.setattr(policy_files, "LARGEST_LIST", length - 1)
    assert "damaged, or not an .npz file" in refused(file)


@pytest.mark.parametrize(("more", "message"), [(59, "a q policy has"), (60, "more than 64 arrays")])
def test_a_file_may_hold_64_arrays(file, more, message):
    remade(file, **{f"other{k}": np.zeros(1) for k in range(more)})
    assert message in refused(file)


@pytest.mark.parametrize(("more", "message"), [(0, "expected 360 inputs"), (1, "not a list of at most 360 numbers")])
def test_the_sensors_of_a_file_are_no_more_than_those_of_a_design(file, more, message):
    rows = {name: [1.0] * (MOST_SENSORS + more) for name in ("bearings", "ranges", "fields_of_view")}
    remade(file, sensors=rows)
    assert message in refused(file)


def test_an_array_that_is_as_large_as_its_shape_claims_is_read_and_one_that_claims_more_is_not(file):
    with np.load(file) as found:
        arrays = {name: found[name] for name in found.files}
    for name in ("outer", "header"):
        with zipfile.ZipFile(file, "w") as archive:
            for other, array in arrays.items():
                buffer = io.BytesIO()
                np.save(buffer, array)
                written = buffer.getvalue()
                archive.writestr(f"{other}.npy", written[:128] if other == name else written)
        assert "larger than the file" in refused(file)
