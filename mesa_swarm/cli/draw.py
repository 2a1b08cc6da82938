"""Pictures of runs, recordings and maps: picture, export, map import, map show."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count
from mesa_swarm.base.files import check_apart, checked_file, write_whole
from mesa_swarm.base.wording import quantity
from mesa_swarm.cli.lines import print_lines
from mesa_swarm.cli.options import (
    MOST_STEPS,
    MOST_STORED,
    Force,
    Model,
    Quiet,
    Seed,
    SeedOrNone,
    Settings,
    built_model,
    files_of,
    prepare,
)
from mesa_swarm.model.gallery import check_model_name, short_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mesa_swarm.maps.map import Map
    from mesa_swarm.swarm_model import SwarmModel

DEFAULT_STEPS = {"stages": "0,1000,3000", "trace": "10000", "ethogram": "500"}
LAST_STEP = 10_000_000
MOST_AREAS = 12

commands = typer.Typer()
map_commands = typer.Typer(help="Look at maps and convert them.", rich_markup_mode=None)


@commands.command("picture")
def picture_command(
    model: Model,
    *,
    kind: Annotated[str, typer.Option(help="stages, trace or ethogram.")] = "stages",
    steps: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Stages at these steps (0,1000,3000); else how many steps.")
    ] = None,
    robots: Annotated[int | None, typer.Option(min=1, help="How many robots a trace or ethogram shows.")] = None,
    setting: Settings = None,
    rng: Seed = 1,
    out: Annotated[Path | None, typer.Option(help="A .png file; results/MODEL_KIND.png by default.")] = None,
    quiet: Quiet = False,
) -> None:
    """Draw a run: its stages, the robots' paths, or the layer that drove each robot."""
    check_choice("kind", kind, DEFAULT_STEPS)
    if robots is not None and kind == "stages":
        raise InvalidValueError(f"robots is {robots}; stages show all of them; leave it out, or ask for another kind")
    chosen = parsed_steps(DEFAULT_STEPS[kind] if steps is None else steps, several=kind == "stages")
    path = checked_file(out or Path("results", f"{short_name(model)}_{kind}.png"), ".png")
    check_apart(path, files_of(model, setting))
    figure = drawn(built_model(model, setting, rng), kind, chosen, robots, not quiet)
    from mesa_swarm.viewing.pictures import png

    print(write_whole(path, png(figure)))


def drawn(model: "SwarmModel", kind: str, steps: list[int], robots: int | None, progress: bool) -> "Figure":
    """Run a model and return a figure of the given kind."""
    from mesa_swarm.viewing.run_pictures import ethogram, stages, trace

    if kind == "stages":
        return stages(model, steps, progress=progress)
    if kind == "trace":
        return trace(model, steps[0], robots=robots or 1, progress=progress)
    model.watch(last=None, columns=("layer",))
    return ethogram(model.run(check_count("steps", steps[0], minimum=1), progress), robots=robots)


def parsed_steps(text: str, several: bool) -> list[int]:
    """Return steps separated by commas."""
    parts = text.split(",")
    whole = all(part.strip().isdecimal() and int(part) <= LAST_STEP for part in parts)
    if not whole or (len(parts) > 1 and not several):
        expected = "steps such as 0,1000,3000" if several else "one number of steps"
        raise InvalidValueError(f"steps is {text!r:.60}; expected {expected}, at most {LAST_STEP:,}")
    return [int(part) for part in parts]


@commands.command("export")
def export_command(
    file: Annotated[
        Path, typer.Argument(metavar="FILE|MODEL", help="A recording; with --live a model, as `run` takes it.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A .png .svg .gif .mp4 .html .csv or .parquet file.")],
    *,
    live: Annotated[bool, typer.Option("--live", help="Write a page that runs the model, without Python.")] = False,
    setting: Settings = None,
    rng: SeedOrNone = None,
    seeds: Annotated[
        int | None, typer.Option(min=0, max=1000, help="The page can begin with the seeds 1 to this; 20 by default.")
    ] = None,
    steps: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Stills or rows of these steps; stills: else the last.")
    ] = None,
    every: Annotated[int | None, typer.Option(min=1, max=MOST_STEPS, help="All steps that are multiples.")] = None,
    first: Annotated[int | None, typer.Option("--from", min=0, max=MOST_STEPS, help="No steps before.")] = None,
    last: Annotated[int | None, typer.Option("--to", min=0, max=MOST_STEPS, help="No steps after.")] = None,
    sheet: Annotated[bool, typer.Option("--sheet", help="Several stills on one sheet.")] = False,
    animate: Annotated[bool, typer.Option("--animate", help="Make an .svg move.")] = False,
    fps: Annotated[float | None, typer.Option(min=1, max=120, help="Frames a second of films and animations.")] = None,
    size: Annotated[str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of a .png .gif or .mp4.")] = None,
    sectors: Annotated[bool, typer.Option("--sectors", help="Draw the sectors of proximity sensors.")] = False,
    trails: Annotated[int, typer.Option(min=0, max=MOST_STORED, help="Draw paths over this many steps.")] = 0,
    table: Annotated[
        str | None, typer.Option(help="robots, fires, contacts, loads, fields or events, as .csv or .parquet.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a recording as pictures, a film, a page or a table, by the ending of OUT; or a model as a live page."""
    others: dict[str, object] = {
        "--steps": steps, "--every": every, "--from": first, "--to": last, "--sheet": sheet, "--animate": animate,
        "--fps": fps, "--size": size, "--sectors": sectors, "--trails": trails, "--table": table,
    }  # fmt: skip
    if live:
        refuse_options(others, "a live page does not take it")
        print(live_page(str(file), out, setting, 1 if rng is None else rng, seeds, force, quiet))
        return
    refuse_options({"--set": setting, "--rng": rng, "--seeds": seeds}, "it is for models; add --live")
    prepare()
    from mesa_swarm.viewing.export import export as write
    from mesa_swarm.viewing.pictures import parsed_size

    paths = write(
        file,
        out,
        steps=None if steps is None else parsed_steps(steps, several=True),
        every=every,
        first=first,
        last=last,
        sheet=sheet,
        animate=animate,
        fps=fps,
        size=None if size is None else parsed_size(size),
        sectors=sectors,
        trails=trails,
        table=table,
        overwrite=force,
        progress=not quiet,
    )
    print("\n".join(map(str, paths)))


def refuse_options(options: dict[str, object], why: str) -> None:
    """Refuse the first option that is given."""
    for name, value in options.items():
        if value not in (None, False, 0):
            raise InvalidValueError(f"{name} is given; {why}")


def live_page(
    model: str, out: Path, setting: list[str] | None, rng: int, seeds: int | None, force: bool, quiet: bool
) -> Path:
    """Write a page that runs a model, and return its path."""
    check_apart(out, files_of(check_model_name(model), setting))
    made = built_model(model, setting, rng)
    count = {} if seeds is None else {"seeds": seeds}
    return made.export(out, live=True, overwrite=force, progress=not quiet, **count)


@map_commands.callback(invoke_without_command=True)
def _map(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


@map_commands.command("import")
def import_map(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A .svg, .map or .toml file, or a built-in name.")],
    out: Annotated[
        Path | None, typer.Argument(metavar="[OUT.toml]", help="FILE's name as .toml, in this folder, by default.")
    ] = None,
    *,
    force: Force = False,
) -> None:
    """Write a map as TOML, or as SVG if OUT ends in .svg."""
    from mesa_swarm.maps.map import Map

    world = Map.load(file)
    target = Path(f"{Path(file).stem}.toml") if out is None else out
    check_apart(target, [file])
    if target.exists() and not force:
        raise InvalidValueError(f"{target} exists already; choose another name or add --force")
    world.save(target)
    print_lines([describe_map(world)], 14)
    print(target)


@map_commands.command("show")
def show_map(
    file: Annotated[str, typer.Argument(metavar="FILE|NAME", help="A map file or a built-in name.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Draw it as this .png.")] = None,
) -> None:
    """Print what is on a map, and draw it on request."""
    from mesa_swarm.maps.map import Map

    world = Map.load(file)
    if out is not None:
        check_apart(checked_file(out, ".png"), [file])
    print_lines([describe_map(world)], 14)
    if out is not None:
        from mesa_swarm.swarm_model import SwarmModel
        from mesa_swarm.viewing.pictures import png, world_figure

        print(write_whole(out, png(world_figure({world.name: SwarmModel(map=world, rng=1)}))))


def describe_map(world: "Map") -> str:
    """Return a map's name, size, and the number of obstacles, ground marks and fires, on five lines."""
    solid = [shape.kind for shape in world.obstacles if shape.contact]
    counts = {kind: solid.count(kind) for kind in ("disc", "rectangle", "polygon")}
    kinds = [quantity(count, kind) for kind, count in counts.items() if count]
    areas = [f"{fire.area:.3g}" for fire in world.fires][:MOST_AREAS]
    areas += ["..."] if len(world.fires) > MOST_AREAS else []
    facts = {
        "name": world.name,
        "size": f"{world.width:g} x {world.height:g}",
        "obstacles": f"{len(solid)} ({', '.join(kinds)})" if kinds else 0,
        "ground marks": len(world.obstacles) - len(solid),
        "fires": f"{len(world.fires)} (areas {', '.join(areas)})" if areas else 0,
    }
    return "\n".join(f"{name:12}  {fact}" for name, fact in facts.items())
