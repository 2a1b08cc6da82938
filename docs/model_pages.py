"""A hook of MkDocs: a page for each model of the gallery, made of its docstring, its code and the file beside it."""

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from mesa_swarm.about import model_info
from mesa_swarm.gallery import gallery_names


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the pages, which are not files in the folder."""
    for name in gallery_names():
        files.append(File.generated(config, f"models/{name}.md", content=page_of(name)))
    return files


def page_of(name: str) -> str:
    """Return the page of a model as Markdown."""
    info = model_info(name)
    return info.markdown(level=1, command=info.command)
