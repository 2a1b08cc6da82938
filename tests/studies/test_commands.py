"""bench, reproduce and validate: what is measured, and printed of it."""

import pytest

from mesa_swarm.model.gallery import find_model
from mesa_swarm_studies.benchmarks import speed as bench
from mesa_swarm_studies.benchmarks.speed import Goal, Measurement
from mesa_swarm_studies.registry import items
from mesa_swarm_studies.thesis import differences


def refused(effort):
    raise bench.NotMeasuredError("this machine has one processor")


def no_compiler(folder):
    raise bench.NotMeasuredError("there is no C compiler here")


GOALS = (Goal(what="ten", unit="ms", limit=12.0), Goal(what="memory", unit="GB", limit=1.5))
BESIDE_C = bench.StepBesideC(bare=1e-6, plain=5e-6, collected=9e-6, plain_ratio=5.0, collected_ratio=9.0)
PRETENDED = (
    Measurement(goals=GOALS, measure=lambda effort: [11.0, float("nan")], quick=True),
    Measurement(goals=(Goal(what="two", unit="as fast", limit=1.75, least=True),), measure=refused, quick=True),
    Measurement(goals=(Goal(what="start", unit="s", limit=0.5),), measure=lambda effort: [0.7]),
    Measurement(goals=(Goal(what="training", unit="s"),), measure=lambda effort: [1234.5]),
)


@pytest.fixture
def pretended(monkeypatch):
    """A report whose steps and measurements take no time."""
    monkeypatch.setattr(bench, "TARGETS", {1000: 0.15, 10_000: 5.0})
    monkeypatch.setattr(bench, "step_seconds", lambda step, repetitions, budget: 1e-4)
    monkeypatch.setattr(bench, "peer_workload", lambda n: find_model("collision_avoidance")(n_robots=3, rng=1))
    monkeypatch.setattr(bench, "MEASUREMENTS", PRETENDED)
    monkeypatch.setattr(bench, "BESIDE_C", {10: 8.0, 10_000: 2.5})
    monkeypatch.setattr(bench.BareProgram, "compile_into", bench.BareProgram)
    monkeypatch.setattr(bench, "step_beside_c", lambda program, n, effort: BESIDE_C)


@pytest.mark.slow
def test_bench_prints_its_report_and_the_paths(typed, tmp_path, pretended):
    status, out, _ = typed("bench --quick")
    assert status == 0
    assert "growth exponent from 1,000 to 10,000 robots, one thread: 0 (required: at most 1.05, passed)" in out
    names = {path.name for path in (tmp_path / "results" / "bench").iterdir()}
    assert names == {"step.csv", "bare_c.csv", "goals.csv", "complexity.png"}


@pytest.mark.slow
def test_bench_prints_value_and_goal_of_each_measurement_or_why_it_has_none(typed, tmp_path, pretended):
    _, out, _ = typed("bench")
    assert "ten, ms: 11 (required: at most 12.0, passed)" in out
    assert "memory, GB: not measured, this system does not show it" in out
    assert "two, as fast: not measured, this machine has one processor" in out
    assert "start, s: 0.7 (required: at most 0.5, MISSED)" in out
    assert "training, s: 1,234\n" in out
    rows = (tmp_path / "results" / "bench" / "goals.csv").read_text().splitlines()
    assert rows[0] == "what,unit,measured,required,bound,passed"
    assert rows[2:] == [
        '"10 robots, a collected step beside a bare C program",times as long,9.0,8.0,most,no',
        '"10,000 robots, a collected step beside a bare C program",times as long,9.0,2.5,most,no',
        "ten,ms,11.0,12.0,most,yes",
        "memory,GB,,1.5,most,",
        "two,as fast,,1.75,least,",
        "start,s,0.7,0.5,most,no",
        "training,s,1234.5,,,",
    ]


@pytest.mark.slow
def test_a_quick_bench_leaves_out_what_takes_long(typed, pretended):
    out = typed("bench --quick")[1]
    assert "start, s" not in out
    assert [line.split() for line in out.splitlines() if line.endswith("  no")] == [
        ["10", "1", "5", "5", "9", "9", "8", "no"]
    ]


@pytest.mark.slow
def test_bench_states_in_a_line_that_there_is_no_c_compiler(typed, tmp_path, pretended, monkeypatch):
    monkeypatch.setattr(bench.BareProgram, "compile_into", no_compiler)
    _, out, _ = typed("bench --quick")
    line = "a step beside a bare C program of the same work: not measured, there is no C compiler here"
    assert line in out.splitlines()
    assert (tmp_path / "results" / "bench" / "bare_c.csv").read_text().splitlines()[1:] == ["10,,,,,,8.0"]


def test_reproduce_lists_a_line_for_every_figure(typed, tmp_path):
    status, out, err = typed("reproduce --list")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == list(items())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "listed"),
    [
        ("--figure D.3 --figure 8.1", ["8.1", "D.3"]),
        ("--readings", [figure for figure, item in items().items() if item.source == "reading"]),
        ("--published", [figure for figure, item in items().items() if item.source == "paper"]),
        ("--all", [figure for figure, item in items().items() if item.source == "thesis"]),
    ],
)
def test_reproduce_lists_only_what_is_selected(typed, options, listed):
    status, out, err = typed(f"reproduce {options} --list")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == listed
    assert typed("reproduce --list --figure 8.9")[0] == 2


def test_a_report_of_one_figure_does_not_claim_all_results(typed, tmp_path):
    assert typed("reproduce --figure D.3 --quiet --report page.md")[0] == 0
    page = (tmp_path / "page.md").read_text()
    assert page.startswith("# Selected results\n\nThis page has only these of ")
    assert "All results" not in page


def test_reproduce_lists_the_state_of_every_item_or_writes_their_page(typed, tmp_path):
    status, out, err = typed("reproduce --items")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()[:-1]] == [str(number) for number in range(1, 206)]
    assert not list(tmp_path.iterdir())
    assert typed("reproduce --items --report page.md")[:2] == (0, "page.md\n")
    assert (tmp_path / "page.md").read_text() == differences.page()


@pytest.mark.slow
def test_a_figure_is_written_as_pictures_and_a_table_and_its_verdict_is_printed(typed, tmp_path):
    status, out, err = typed("reproduce --figure D.3 --figure 8.1 --quick --quiet --jobs 1")
    assert (status, err) == (0, "")
    made = tmp_path / "results" / "reproduction"
    names = {path.name for path in made.iterdir()}
    assert {f"figure_{f}_quick.{end}" for f in ("8.1", "D.3") for end in ("png", "svg", "csv")} <= names
    assert (made / "figure_8.1_quick.png").read_bytes()[1:4] == b"PNG"
    verdicts = [line.split(":")[0] for line in out.splitlines() if line[:1] in "8D"]
    assert verdicts == ["8.1   confirmed with limits (quick)", "D.3   confirmed (quick)"]


@pytest.mark.slow
def test_the_same_figure_gives_the_same_files(typed, tmp_path):
    for folder in ("a", "b"):
        typed(f"reproduce --figure D.1 --quick --quiet --out {folder}")
    for end in ("png", "svg", "csv"):
        first, second = (tmp_path / folder / f"figure_D.1_quick.{end}" for folder in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.slow
def test_quick_results_do_not_take_the_place_of_full_ones(typed, tmp_path):
    typed("reproduce --figure B.1 --quiet --out here")
    full = {path: path.read_bytes() for path in (tmp_path / "here").glob("figure_*")}
    typed("reproduce --figure B.1 --quick --quiet --out here")
    assert full
    assert {path: path.read_bytes() for path in full} == full
    assert len(list((tmp_path / "here").glob("figure_*_quick.*"))) == len(full)


@pytest.mark.slow
def test_a_quick_report_warns_that_its_verdicts_mean_nothing(typed, tmp_path):
    assert typed("reproduce --figure B.1 --quick --quiet --report page.md")[0] == 0
    page = (tmp_path / "page.md").read_text()
    assert "these verdicts mean nothing" in page
    assert "| B.1 | how a fire's temperature grows | **confirmed with limits (quick)** |" in page


def test_a_page_has_the_pictures_of_its_results_beside_it(typed, tmp_path):
    typed("reproduce --figure B.1 --quick --quiet --report page.md")
    assert "![how a fire's temperature grows](pictures/B.1.png)" in (tmp_path / "page.md").read_text()
    assert (tmp_path / "pictures" / "B.1.png").read_bytes().startswith(b"\x89PNG")


def test_validate_lists_what_theories_predict(typed, tmp_path):
    theories = [figure for figure, item in items().items() if item.source == "theory"]
    status, out, err = typed("validate --list")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == theories
    assert [line.split()[0] for line in typed("validate --list --only sector_hits")[1].splitlines()] == ["sector_hits"]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_validate_prints_and_writes_a_table_of_quantities_beside_their_theory(typed, tmp_path):
    status, out, err = typed("validate --only walker_coverage --quick --quiet --jobs 1 --report page.md")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith("walker_coverage: independent walkers cover")
    assert lines[1].split("  ")[0] == "quantity and setting"
    assert any(line.startswith("share of cells that 5 robots visit") and " 0.15" in line for line in lines)
    made = tmp_path / "results" / "validation"
    assert (made / "figure_walker_coverage_quick.csv").read_text().startswith("claim,theory,measured,")
    assert not (made / "validation_quick.csv").exists(), "the table of all items is not replaced by one of a few"
    assert (made / "figure_walker_coverage_quick.png").exists()
    assert (tmp_path / "page.md").read_text().startswith("# Selected results")
    assert typed("validate --only walker_coverage --quick --quiet --jobs 1")[1].splitlines()[2:10] == lines[2:10]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("validate --only kinetic", "unknown item 'kinetic'; did you mean 'kinetic_collisions'?"),
        ("validate --only 8.3", "unknown item '8.3'"),
        ("validate --report page.html", "expected the name of a .md file"),
        ("validate --jobs 0", "jobs is 0"),
        ("validate --out /proc/nowhere", "results cannot be written to"),
        ("reproduce --figure 8.9", "unknown figure '8.9'; did you mean"),
        ("reproduce --all --figure 8.2", "--all and --figure are given at once"),
        ("reproduce --readings --published", "--published and --readings are given at once"),
        ("reproduce --figure 6.3", "unknown figure '6.3'; what earlier versions called so is '6.5'"),
        ("reproduce --published --figure 8.2", "--published and --figure are given at once"),
        ("reproduce --items --figure 8.2", "--figure and --items are given at once"),
        ("reproduce --items --report page.html", "expected the name of a .md file"),
        ("reproduce --figure 8.2 --report page.html", "expected the name of a .md file"),
        ("reproduce --figure 8.2 --jobs 0", "jobs is 0"),
        ("reproduce --figure 8.2 --out /proc/nowhere", "results cannot be written to"),
        ("reproduce --figure", "requires an argument"),
    ],
)
def test_a_wrong_reproduction_is_refused_in_one_line(typed, line, words, tmp_path):
    status, out, err = typed(line)
    assert (status, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
