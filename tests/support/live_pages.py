"""Live pages in tests: what Node makes of them, and what Python does."""

import json
import shutil
import subprocess
from base64 import b64encode
from pathlib import Path

import pytest

import mesa_swarm.live

NODE = shutil.which("node")
LIVE = Path(mesa_swarm.live.__file__).with_name("live.js")
SCRIPT = """
import {{ LiveModel, added }} from {module};
import {{ readFileSync }} from "fs";
const page = JSON.parse(readFileSync(process.argv[2])), bytes = (text) => new Uint8Array(Buffer.from(text, "base64"));
const first = page.about.starts[0], own = bytes(page.content[`start-${{first.key}}`]), starts = new Map();
for (const {{ key, differs, begins, places, changes }} of page.about.starts) {{
  const content = bytes(page.content[`start-${{key}}`]);
  const begun = begins ? bytes(page.content[`begun-${{key}}`]) : undefined;
  starts.set(key, {{ changes, places: places ?? first.places, image: differs ? added(content, own) : content, begun }});
}}
const model = new LiveModel(bytes(page.content.module), page.about, starts);
const answer = (() => {{ {body} }})();
console.log(JSON.stringify(answer));
"""


def ask_node(page, body, folder):
    """Return what a script answers in Node: its variable `model` is the model of a `LivePage`."""
    if NODE is None:
        pytest.skip("there is no node (Debian: apt install nodejs)")
    about, content = page.parts()
    source, script = folder / "page.json", folder / "script.mjs"
    texts = {name: b64encode(piece).decode() for name, piece in content.items()}
    source.write_text(json.dumps({"about": about, "content": texts}))
    script.write_text(SCRIPT.format(module=json.dumps(str(LIVE)), body=body))
    call = subprocess.run([NODE, str(script), str(source)], capture_output=True, text=True, check=False)
    assert call.returncode == 0, call.stderr
    return json.loads(call.stdout)


def hashes_in_python(model, steps):
    """Return the fingerprint of a model after each of these numbers of steps, or at its end."""
    found = []
    for step in steps:
        if model.running:
            model.run(step - model.steps)
        found.append([model.steps, model.state_hash()])
    return found


def hashes_in_node(steps, seed):
    """Return the body of a script that answers the same."""
    return f"""
    model.reset({{ seed: {seed} }});
    return {list(steps)}.map((step) => {{ model.step(step - model.steps); return [model.steps, model.hash()]; }});
    """
