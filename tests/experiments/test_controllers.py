"""Controllers from outside: of policies, graphs, Stable-Baselines3 and modules; each fault is one line."""

import base64
import json
import re
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm import AGENT9, AGENT_FIRE, SwarmModel
from mesa_swarm.base import extras
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, LearningError, SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments import CollisionAvoidance, ExtinguishFires, VectorSwarmEnv
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.experiments.controllers import COLDEST, Controller, algorithm_of, load_controller, played
from mesa_swarm.learning import LearnFires, LearnFireWheels, PolicyLayer, export_onnx, save_policy
from mesa_swarm.learning.onnx_files import OnnxPolicy, onnx_session
from support.c_code import drawn_inputs
from support.exported_policies import NINE, POLICIES, q

SEEN = np.linspace(0, 1, 45, dtype=np.float32).reshape(5, 9)
MINE = '''
"""Controllers of a user."""
import numpy as np
from mesa_swarm.control import Avoid, Explore, Subsumption

rule = Subsumption(Avoid(), Explore())
seven = 7

def toward_space(seen):
    return np.stack([seen[:, 1], 3 * seen[:, 2]], axis=1)

def numbered(seen):
    return np.full(len(seen), 3)

class Counting:
    def __init__(self):
        self.steps = 0
    def act(self, seen):
        self.steps += 1
        return np.full((len(seen), 2), 0.01 * self.steps)

class Broken:
    def __init__(self):
        raise OSError("no licence")

def too_few(seen):
    return np.zeros((len(seen) - 1, 2))

def undefined(seen):
    return np.full((len(seen), 2), np.nan)

def failing(seen):
    return seen[:, 99]

def leaving(seen):
    raise SystemExit(3)

def three_each(seen):
    return np.zeros((len(seen), 3))

def beyond(seen):
    return np.full(len(seen), 8)
'''


@pytest.fixture
def mine(tmp_path):
    file = tmp_path / "foreign_acts.py"
    file.write_text(MINE)
    return str(file)


def driven(control, steps=60):
    model = SwarmModel(map="original", rng=3)
    model.add_robots(AGENT9, 6)
    model.control = control
    return model.run(steps)


def test_a_saved_policy_drives_as_its_layer_does(tmp_path):
    policy = q(4)
    controller = load_controller(save_policy(policy, tmp_path / "mine.npz"))
    assert controller.name == "mine.npz"
    assert driven(controller.control).state_hash() == driven(Subsumption(PolicyLayer(policy=policy))).state_hash()


def test_a_function_of_a_file_acts_on_observations_and_is_cut_off_at_full_speed(mine):
    act = load_controller(f"{mine}:toward_space").actor("continuous")
    expected = np.stack([SEEN[:, 1], np.minimum(3 * SEEN[:, 2], 1)], axis=1)
    assert act(SEEN) == pytest.approx(expected)
    assert expected.max() == 1


@pytest.mark.parametrize(("folder", "file"), [("f" * 120, "near"), ("", "f" * 120)])
def test_a_controller_in_a_folder_or_file_of_a_long_name_has_a_short_one(tmp_path, folder, file):
    path = tmp_path / folder / f"{file}.py"
    path.parent.mkdir(exist_ok=True)
    path.write_text("def act(seen):\n    return seen[:, :2] * 0\n")
    controller = load_controller(f"{path}:act")
    assert len(controller.name) <= 100
    assert controller.name.endswith(".py:act")


def test_a_function_drives_all_robots_of_an_environment(mine):
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=5, map="openspace", max_steps=20), n_worlds=1)
    act, seen = load_controller(f"{mine}:toward_space").actor("continuous"), env.reset(seed=1)
    for _ in range(5):
        seen, reward, *_ = env.step(act(seen[0])[None])
    assert reward.shape == (1, 5)


def test_all_kinds_drive_the_same_world_of_a_task(mine, tmp_path):
    task = CollisionAvoidance(n_robots=4, map="openspace", max_steps=15)
    policy, rule = load_controller(save_policy(q(4), tmp_path / "mine.npz")), load_controller(f"{mine}:rule")
    found = [TaskWorld(task=task, control=one.control, rng=1).play() for one in (policy, rule)]
    found.append(TaskWorld(task=task, rng=1).play(load_controller(f"{mine}:toward_space").actor(task.actions)))
    assert [measures["steps"] for measures in found] == [15, 15, 15]
    assert len({measures["speed ahead"] for measures in found}) == 3


@pytest.mark.parametrize("learner", [LearnFires, LearnFireWheels])
@pytest.mark.parametrize("greedy", [False, True])
def test_a_file_of_a_policy_of_fires_drives_by_its_own_layer(learner, greedy, tmp_path):
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT_FIRE, 3)
    model.control = Subsumption(learner())
    policy = model.run(60).control.layers[0].policy()
    controller = load_controller(save_policy(policy, tmp_path / "fires.npz"), greedy=greedy)
    *above, layer = controller.control.layers
    assert [type(each) for each in above] == ([Avoid] if learner is LearnFires else [])
    assert (type(layer), layer.frozen) == (learner, True)
    assert layer.start.temperature == (COLDEST if greedy else policy.temperature)
    assert played(controller, ExtinguishFires(n_robots=3, max_steps=30), 1)["steps"] == 30


def test_numbered_actions_stay_whole_numbers(mine):
    assert load_controller(f"{mine}:numbered").actor(4)(SEEN).tolist() == [3] * 5


def test_numbers_of_actions_are_wheel_speeds_where_these_are_asked_for(mine):
    controller = load_controller(f"{mine}:numbered")
    assert controller.actor("continuous")(SEEN).tolist() == [[1.0, 1.0]] * 5
    with pytest.raises(BehaviourError, match=r"expected finite numbers \(n, 3\)$"):
        controller.actor("continuous", 3)(SEEN)


def test_numbers_beyond_the_actions_of_a_task_are_refused(mine):
    with pytest.raises(BehaviourError, match=r"expected whole numbers \(n,\) from 0 to 3"):
        load_controller(f"{mine}:beyond").actor(4)(SEEN)


def test_an_object_of_a_class_is_made_anew_for_each_world(mine):
    controller = load_controller(f"{mine}:Counting")
    one, other = controller.actor("continuous"), controller.actor("continuous")
    assert [one(SEEN)[0, 0] for _ in range(3)] == pytest.approx([0.01, 0.02, 0.03])
    assert other(SEEN)[0, 0] == pytest.approx(0.01)


def test_an_arbiter_of_a_file_drives_as_itself(mine):
    control = load_controller(f"{mine}:rule").control
    assert driven(control).state_hash() == driven(Subsumption(Avoid(), Explore())).state_hash()


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("too_few", r"returned an array of float64, shape \(4, 2\) for 5 robots; expected finite numbers \(n, 2\)"),
        ("undefined", "for 5 robots; expected finite numbers"),
        ("three_each", r"shape \(5, 3\) for 5 robots; expected finite numbers \(n, 2\)"),
        ("beyond", r"or whole numbers \(n,\) from 0 to 7"),
        ("leaving", "failed: .*3"),
        ("failing", "failed: .*99"),
        ("Broken", "cannot be made: .*no licence"),
    ],
)
def test_what_a_controller_returns_is_checked(mine, name, line):
    with pytest.raises(BehaviourError, match=line) as caught:
        load_controller(f"{mine}:{name}").actor("continuous")(SEEN)
    assert len(str(caught.value).splitlines()) == 1


def test_numbers_with_a_fraction_are_not_actions_by_number(mine):
    with pytest.raises(BehaviourError, match=r"expected whole numbers \(n,\) from 0 to 7"):
        load_controller(f"{mine}:toward_space").actor(8)(SEEN)


def test_observations_of_another_width_are_refused():
    controller = Controller(name="narrow", make=lambda: lambda seen: seen[:, :2], width=8)
    with pytest.raises(InvalidValueError, match="takes 8 observations of a robot and the task has 9"):
        controller.actor("continuous")(SEEN)


@pytest.mark.parametrize(
    ("spec", "line"),
    [
        ("missing.npz", "there is no policy"),
        ("missing.onnx", "there is no file missing.onnx"),
        ("missing.zip", "there is no file missing.zip"),
        ("./missing.py:act", "no such file; expected the path of a Python file"),
        ("no_such_module:act", "there is no module"),
        ("math:no_such_function", "there is no 'no_such_function' in math"),
        ("math:pi", "expected a function of observations"),
        ("mine.txt", "expected file.npz, file.onnx"),
        (5, "the controller is 5; expected file.npz"),
    ],
)
def test_a_controller_that_is_not_there_is_one_line(spec, line):
    with pytest.raises(SwarmError, match=line) as caught:
        load_controller(spec)
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_of_a_module_needs_a_name(mine):
    with pytest.raises(InvalidValueError, match=r"expected package\.module:name"):
        load_controller(mine)


def test_a_controller_by_observations_has_no_control_and_the_other_way_round(tmp_path):
    with pytest.raises(InvalidValueError, match="expected either a control or a make"):
        Controller(name="both", control=Subsumption(Explore()), make=lambda: lambda seen: seen)
    with pytest.raises(InvalidValueError, match="drive robots by its control"):
        load_controller(save_policy(q(4), tmp_path / "mine.npz")).actor("continuous")


@pytest.mark.parametrize(
    ("module", "more", "algorithm"),
    [
        ("stable_baselines3.common.policies", {"clip_range": 0.2}, "PPO"),
        ("stable_baselines3.common.policies", {}, "A2C"),
        ("stable_baselines3.sac.policies", {}, "SAC"),
        ("stable_baselines3.td3.policies", {}, "TD3"),
        ("stable_baselines3.dqn.policies", {}, "DQN"),
    ],
)
def test_the_algorithm_is_read_without_unpickling(tmp_path, module, more, algorithm):
    settings = {"policy_class": {"__module__": module, ":serialized:": ENDS}, **more}
    assert algorithm_of(sb3_file(tmp_path, settings)) == algorithm


# A pickle, as Stable-Baselines3 stores them, that would end this process.
ENDS = base64.b64encode(b"cos\n_exit\n(I7\ntR.").decode()


def sb3_file(folder, settings=(), *, without=(), method=zipfile.ZIP_STORED, **parts):
    """Write a file as Stable-Baselines3 packs it, with settings and parts of its own; return its path."""
    spaces = {name: {":type:": "Box"} for name in ("observation_space", "action_space")}
    usual = {"policy_class": {"__module__": "stable_baselines3.common.policies"}, **spaces, **dict(settings)}
    contents = {"data": json.dumps(usual), "policy.pth": b"x" * 100, "_stable_baselines3_version": "2.4.0", **parts}
    file = folder / "saved.zip"
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in contents.items():
            if name not in without:
                archive.writestr(name, content)
    return file


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\5\6" + b"\xff" * 18, None])
def test_other_archives_are_refused(tmp_path, content):
    file = tmp_path / "saved.zip"
    if content is None:
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("other", "x")
    else:
        file.write_bytes(content)
    with pytest.raises(SwarmError, match="is not a file that Stable-Baselines3 saved"):
        load_controller(file)


DEFLATED = zipfile.ZIP_DEFLATED


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"without": ["data"]}, "it has no data"),
        ({"without": ["policy.pth"]}, "it has no policy.pth"),
        ({"without": ["_stable_baselines3_version"]}, "it has no _stable_baselines3_version"),
        ({"data": "[" * 100_000}, "it is damaged"),
        ({"data": b"\xff\xfe"}, "it is damaged"),
        ({"data": "[]"}, "its settings have no policy_class"),
        ({"settings": {"action_space": 3}}, "its settings have no policy_class, observation_space, action_space"),
        ({"settings": {"policy_class": {}}}, "it is damaged"),
        ({"data": " " * (9 << 20)}, "or its settings to more than a few MB"),
        ({"data": " " * (7 << 20), "method": DEFLATED}, "bytes unpack to 7,340,1"),
        ({"more.pth": b"\0" * (20 << 20), "method": DEFLATED}, "bytes unpack to 20,97"),
        ({f"{k}.pth": b"" for k in range(70)}, "more than 64 parts"),
        ({"method": zipfile.ZIP_LZMA}, "compressed by another method"),
    ],
)
def test_an_archive_that_only_looks_like_one_of_stable_baselines_is_not_given_to_it(
    tmp_path, monkeypatch, options, why
):
    monkeypatch.setattr(
        "mesa_swarm.experiments.controllers.require_extra", lambda *_: pytest.fail("it was given to it")
    )
    file = sb3_file(tmp_path, **options)
    with pytest.raises(
        LearningError, match=rf"is not a file that Stable-Baselines3 saved: .*{re.escape(why)}"
    ) as caught:
        load_controller(file)
    assert len(str(caught.value)) <= 300


def test_two_parts_of_one_name_are_refused(tmp_path):
    file = sb3_file(tmp_path)
    with zipfile.ZipFile(file, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("data", "{}")
    with pytest.raises(LearningError, match="or two of one name"):
        algorithm_of(file)


def test_a_folder_is_not_an_archive(tmp_path):
    (tmp_path / "saved.zip").mkdir()
    with pytest.raises(LearningError, match="it is a folder or device"):
        load_controller(tmp_path / "saved.zip")


def test_a_missing_package_is_named_with_the_command_that_installs_it(tmp_path, monkeypatch):
    file = sb3_file(tmp_path)
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match=re.escape(install_command("sb3"))):
        load_controller(file)


@pytest.mark.parametrize("error", [SystemExit(3), RuntimeError("of\na pickle"), RecursionError()])
def test_whatever_loading_raises_is_one_line(tmp_path, monkeypatch, error):
    def load(*_, **__):
        raise error

    foreign = SimpleNamespace(PPO=SimpleNamespace(load=load), A2C=SimpleNamespace(load=load))
    monkeypatch.setattr("mesa_swarm.experiments.controllers.require_extra", lambda *_: None)
    monkeypatch.setattr("mesa_swarm.experiments.controllers.import_module", lambda name: foreign)
    with pytest.raises(LearningError, match="cannot be loaded as A2C") as caught:
        load_controller(sb3_file(tmp_path))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Q of 4 actions", "a recurrent network of 2 robots, typed"])
def test_an_exported_graph_drives_as_its_policy(name, tmp_path):
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    policy = POLICIES[name]
    file = export_onnx(policy, tmp_path / "mine.onnx")
    controller, expected = load_controller(file), driven(Subsumption(PolicyLayer(policy=policy)))
    assert np.abs(driven(controller.control).swarm.position - expected.swarm.position).max() < 1e-6
    again, inputs = OnnxPolicy.of(onnx_session(file), "mine.onnx"), drawn_inputs(NINE, 100, np.random.default_rng(1))
    assert (again.sensors, again.steps) == (policy.sensors, policy.steps)
    assert np.abs(again.act(*inputs) - policy.act(*inputs)).max() < 1e-6
    assert np.abs(again.act(*inputs[:2]) - policy.act(*inputs[:2])).max() < 1e-6


def foreign_graph(file, *, kind=1, batch="n", width=9):
    """Write a graph whose actions are the first two observations; return its path."""
    onnx = pytest.importorskip("onnx")
    make = onnx.helper
    graph = make.make_graph(
        [make.make_node("Gather", ["seen", "first"], ["actions"], axis=1)],
        "foreign",
        [make.make_tensor_value_info("seen", kind, [batch, width])],
        [make.make_tensor_value_info("actions", kind, [batch, 2])],
        [onnx.numpy_helper.from_array(np.array([0, 1]), "first")],
    )
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 15)], ir_version=8)
    onnx.save(model, file)
    return file


@pytest.mark.slow
def test_a_foreign_graph_acts_on_observations(tmp_path):
    pytest.importorskip("onnxruntime")
    controller = load_controller(foreign_graph(tmp_path / "net.onnx"))
    assert controller.width == 9
    assert controller.actor("continuous")(SEEN) == pytest.approx(SEEN[:, :2])
    with pytest.raises(InvalidValueError, match="takes 9 observations"):
        controller.actor("continuous")(SEEN[:, :5])


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"kind": 11}, {"batch": 1}])
def test_foreign_graphs_of_other_inputs_are_refused(tmp_path, options):
    pytest.importorskip("onnxruntime")
    with pytest.raises(SwarmError, match=r"expected one of float32 \(n, width\)"):
        load_controller(foreign_graph(tmp_path / "net.onnx", **options))


def written(file, nodes, constants=(), *, inputs=("seen",), functions=(), **more):
    """Write a graph of these operators that takes observations and returns "actions"; return its path."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    make = onnx.helper
    values = [make.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["n", 9]) for name in inputs]
    results = [make.make_tensor_value_info("actions", onnx.TensorProto.FLOAT, None)]
    graph = make.make_graph(nodes, "foreign", values, results, list(constants), **more)
    domains = [make.make_opsetid("", 17), make.make_opsetid("own", 1)]
    model = make.make_model(graph, opset_imports=domains, ir_version=8, functions=functions)
    file.write_bytes(model.SerializeToString())
    return file


def nodes_of(*rows):
    """Return operators: name, inputs and outputs, in words, and attributes."""
    make = pytest.importorskip("onnx").helper
    return [make.make_node(name, ins.split(), outs.split(), **more) for name, ins, outs, more in rows]


def endless(onnx):
    """Return an operator that repeats another one for ever, and its constants."""
    make, kinds = onnx.helper, onnx.TensorProto
    truth, count = (
        make.make_tensor_value_info(name, kind, []) for name, kind in (("go", kinds.BOOL), ("k", kinds.INT64))
    )
    state, again, kept = (
        make.make_tensor_value_info(name, kind, None)
        for name, kind in (("state", kinds.FLOAT), ("again", kinds.BOOL), ("kept", kinds.FLOAT))
    )
    inner = [make.make_node("Identity", ["go"], ["again"]), make.make_node("Identity", ["state"], ["kept"])]
    body = make.make_graph(inner, "body", [count, truth, state], [again, kept])
    constants = [onnx.numpy_helper.from_array(np.array(True), "forever")]
    return make.make_node("Loop", ["", "forever", "seen"], ["actions"], body=body), constants


@pytest.mark.slow
@pytest.mark.parametrize("within", [False, True], ids=["", "within a branch"])
def test_a_graph_that_may_run_without_end_is_refused(tmp_path, within):
    onnx = pytest.importorskip("onnx")
    node, constants = endless(onnx)
    if within:
        branch = onnx.helper.make_graph([node], "branch", [], [onnx.helper.make_tensor_value_info("actions", 1, None)])
        node = onnx.helper.make_node("If", ["forever"], ["actions"], then_branch=branch, else_branch=branch)
    file = written(tmp_path / "net.onnx", [node], constants)
    with pytest.raises(LearningError, match="its operator Loop may run without end; export it without loops"):
        load_controller(file)


@pytest.mark.slow
@pytest.mark.parametrize("calls", [{"a": "a"}, {"a": "bb", "b": "a"}, {"a": "b" * 400, "b": "c" * 400, "c": ""}])
def test_functions_of_a_graph_that_call_themselves_or_become_very_many_operators_are_refused(tmp_path, calls):
    onnx = pytest.importorskip("onnx")
    make = onnx.helper
    functions = []
    for name, called in calls.items():
        inner = [make.make_node(each, ["x"], [f"y{k}"], domain="own") for k, each in enumerate(called)]
        inner.append(make.make_node("Identity", ["x"], ["y"]))
        functions.append(make.make_function("own", name, ["x"], ["y"], inner, [make.make_opsetid("", 17)]))
    file = written(tmp_path / "net.onnx", nodes_of(("a", "seen", "actions", {"domain": "own"})), functions=functions)
    with pytest.raises(LearningError, match="more than 100,000 operators, or a function that calls itself"):
        load_controller(file)


@pytest.mark.slow
def test_a_graph_with_functions_and_branches_that_end_acts(tmp_path):
    onnx = pytest.importorskip("onnx")
    make = onnx.helper
    inner = [make.make_node("Slice", ["x", "from", "to", "axis"], ["y"])]
    constants = [onnx.numpy_helper.from_array(np.array([k]), name) for k, name in enumerate(("from", "axis", "to"))]
    first = make.make_function("own", "First", ["x", "from", "to", "axis"], ["y"], inner, [make.make_opsetid("", 17)])
    call = nodes_of(("First", "seen from to axis", "actions", {"domain": "own"}))
    file = written(tmp_path / "net.onnx", call, constants, functions=[first])
    assert load_controller(file).actor("continuous")(SEEN) == pytest.approx(SEEN[:, :2])


@pytest.mark.slow
def test_a_graph_that_needs_very_much_memory_fails_in_one_line(tmp_path, capfd):
    doubled = [("Concat", f"{k or 'seen'} {k or 'seen'}", f"{k + 1}", {"axis": 1}) for k in range(40)]
    file = written(tmp_path / "net.onnx", nodes_of(*doubled, ("Identity", "40", "actions", {})))
    with pytest.raises(BehaviourError, match=r"net\.onnx failed") as caught:
        load_controller(file).actor("continuous")(SEEN)
    assert len(str(caught.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_graph_whose_numbers_are_in_another_file_is_refused_and_that_is_not_read(tmp_path):
    onnx = pytest.importorskip("onnx")
    (tmp_path / "secret").write_bytes(np.zeros((9, 2), np.float32).tobytes())
    weights = onnx.numpy_helper.from_array(np.zeros((9, 2), np.float32), "weights")
    onnx.external_data_helper.set_external_data(weights, "secret")
    weights.ClearField("raw_data")
    file = written(tmp_path / "net.onnx", nodes_of(("MatMul", "seen weights", "actions", {})), [weights])
    with pytest.raises(LearningError, match="some of its numbers are in another file"):
        load_controller(file)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("header", "why"),
    [
        ("[" * 100_000, "no valid header"),
        ('{"sensors": {"bearings": [1e999], "ranges": [1], "fields_of_view": [1]}}', "no valid header"),
        ('{"sensors": {"bearings": [1], "ranges": [], "fields_of_view": [1]}}', "no valid header"),
    ],
)
def test_a_graph_of_ours_with_a_wrong_header_is_one_line(tmp_path, header, why):
    onnx = pytest.importorskip("onnx")
    model = onnx.load(export_onnx(q(4), tmp_path / "mine.onnx"))
    model.metadata_props[0].value = header
    onnx.save(model, tmp_path / "mine.onnx")
    with pytest.raises(LearningError, match=why):
        load_controller(tmp_path / "mine.onnx")


@pytest.mark.slow
def test_a_graph_of_ours_that_fails_or_remembers_something_else_is_one_line(tmp_path):
    onnx = pytest.importorskip("onnx")
    model = onnx.load(export_onnx(POLICIES["a recurrent network of 2 robots, typed"], tmp_path / "mine.onnx"))
    entry = model.metadata_props[0]
    header = json.loads(entry.value)
    entry.value = json.dumps({**header, "memory": header["memory"] + 1})
    onnx.save(model, tmp_path / "mine.onnx")
    with pytest.raises(LearningError, match="the ONNX graph failed") as caught:
        driven(load_controller(tmp_path / "mine.onnx").control, steps=1)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage",
    [
        lambda graph: b"not a graph",
        lambda graph: b"\0" * (17 << 20),
        lambda graph: graph.replace(b"Gather", b"Gathex"),
        lambda graph: graph.replace(b"Gather", b"Gathe\xe3"),
        lambda graph: graph.replace(b"seen", b"see\xe3"),
        lambda graph: graph.replace(b"actions", b"action\xe3"),
    ],
)
def test_a_file_that_is_not_a_graph_is_one_line_and_nothing_is_printed(tmp_path, damage, capfd):
    pytest.importorskip("onnxruntime")
    file = foreign_graph(tmp_path / "net.onnx")
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(SwarmError, match="is not a usable ONNX file") as caught:
        load_controller(file)
    assert len(str(caught.value)) <= 300
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["PPO", "A2C", "SAC", "TD3", "DQN"])
def test_a_learner_of_stable_baselines_acts_as_it_predicts(tmp_path, algorithm):
    sb3, gymnasium = pytest.importorskip("stable_baselines3"), pytest.importorskip("gymnasium")
    actions = 4 if algorithm == "DQN" else "continuous"
    options = {"buffer_size": 10} if algorithm in ("SAC", "TD3", "DQN") else {}
    env = gymnasium.make("MesaSwarm/CollisionAvoidance-v0", map="openspace", actions=actions)
    learner = getattr(sb3, algorithm)("MlpPolicy", env, device="cpu", seed=1, **options)
    learner.save(tmp_path / "learner.zip")
    controller = load_controller(tmp_path / "learner.zip")
    assert controller.width == 9
    expected = learner.predict(SEEN, deterministic=True)[0]
    assert controller.actor(actions)(SEEN) == pytest.approx(expected)
