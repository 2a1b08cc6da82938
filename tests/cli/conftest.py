"""Commands as a user types them."""

import pytest

from mesa_swarm import cli


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path):
    """Type a command in an empty folder; get its exit status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            cli.main(line.split() if isinstance(line, str) else line)
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in
