"""Directives whose text is made by running the program: a page can't promise what doesn't work.

`run` executes the commands of its body one after another in the page's own scratch folder, which
begins with a copy of `examples/`, and shows each with what it prints (`:silent:` leaves standard
error out); `run-python` does the same with a block of Python, and `made` shows a picture that one
of them has written. A command that fails is an error of the build. `command-help` and
`configuration` print the parser's and the schema's own words, `catalogue` the effects' own.
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import Any, ClassVar
from unittest.mock import patch

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]


def _environment() -> dict[str, str]:
    """The environment of the build, with this interpreter's commands first."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    return os.environ | {"PATH": path, "COLUMNS": "100", "MPLBACKEND": "Agg", "NO_COLOR": "1"}


class _Executed(SphinxDirective):
    """What both kinds of block share: the page's folder, and how a run is judged."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {"silent": directives.flag}

    @property
    def folder(self) -> Path:
        """The scratch folder of this page, made at its first block."""
        if "scratch" not in self.env.temp_data:
            made = tempfile.TemporaryDirectory(prefix="pendpipe-docs-")
            self.env.temp_data["scratch"] = made
            shutil.copytree(ROOT / "examples", made.name, dirs_exist_ok=True)
        return Path(self.env.temp_data["scratch"].name)

    def done(self, command: list[str] | str) -> str:
        """Run a command; return what it printed, or fail the build."""
        ran = subprocess.run(
            command,
            shell=isinstance(command, str),
            cwd=self.folder,
            env=_environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        if ran.returncode:
            shown = command if isinstance(command, str) else self.block_text
            raise self.severe(f"status {ran.returncode}: {shown}\n{ran.stderr}")
        printed = ran.stdout + ("" if "silent" in self.options else ran.stderr)
        # Where a scratch folder lies is nobody's concern.
        return printed.rstrip().replace(f"{self.folder}/", "")

    def block(self, text: str, language: str) -> list[nodes.Node]:
        """A literal block of the page."""
        node = nodes.literal_block(text, text)
        node["language"] = language
        return [node]


class Run(_Executed):
    """Commands of a shell, a line each, with what they print."""

    def run(self) -> list[nodes.Node]:
        """Execute and show."""
        shown = []
        for line in filter(None, map(str.strip, self.content)):
            printed = self.done(line)
            shown += [f"$ {line}", *([printed] if printed else [])]
        return self.block("\n".join(shown), "console")


class RunPython(_Executed):
    """A block of Python, with what it prints."""

    def run(self) -> list[nodes.Node]:
        """Execute and show."""
        code = "\n".join(self.content)
        printed = self.done([sys.executable, "-c", code])
        shown = self.block(code, "python")
        return [*shown, *(self.block(printed, "text") if printed else [])]


class Picture(_Executed):
    """A picture that a block above has written, by its name in the page's folder."""

    has_content = False
    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"alt": directives.unchanged_required}

    def run(self) -> list[nodes.Node]:
        """Copy it beside the page and show it."""
        made = self.folder / self.arguments[0]
        if not made.exists():
            raise self.severe(f"no block above has written {self.arguments[0]}")
        kept = Path(self.env.srcdir) / "_build" / "made" / f"{self.env.docname}-{made.name}"
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(made, kept)
        node = nodes.image(uri=f"/_build/made/{kept.name}", alt=self.options.get("alt", ""))
        return [node]


class CommandHelp(_Executed):
    """What `pendpipe COMMAND --help` prints, of every command under its heading."""

    has_content = False

    def run(self) -> list[nodes.Node]:
        """Show the help of each."""
        from pendpipe.cli import COMMANDS, STAGES, main

        sections: list[nodes.Node] = []
        for name in [*COMMANDS, *STAGES]:
            section = nodes.section(ids=[nodes.make_id(f"command-{name}")])
            section += nodes.title("", "", nodes.literal("", name))
            # argparse prints it and ends the program.
            with (
                redirect_stdout(io.StringIO()) as said,
                suppress(SystemExit),
                patch.dict(os.environ, _environment()),
            ):
                main([name, "--help"])
            section += self.block(said.getvalue().rstrip(), "text")
            sections.append(section)
        return sections


class Configuration(SphinxDirective):
    """What may stand in `config/config.yaml`, from the schema."""

    def run(self) -> list[nodes.Node]:
        """Parse the schema's manual as Markdown."""
        from pendpipe.commands.small import configuration_manual

        return self.parse_text_to_nodes(configuration_manual())


class Catalogue(SphinxDirective):
    """Every effect, from its own declaration."""

    def run(self) -> list[nodes.Node]:
        """Parse the catalogue's manual as Markdown."""
        from pendpipe.commands.small import catalogue_manual

        return self.parse_text_to_nodes(catalogue_manual().partition("\n")[2])


def _remove_scratch(app: Any, doctree: nodes.document) -> None:
    """The page has been read, and what its blocks have written is shown or copied."""
    if "scratch" in app.env.temp_data:
        app.env.temp_data["scratch"].cleanup()


def setup(app: Any) -> dict[str, bool]:
    """Add the directives."""
    app.connect("doctree-read", _remove_scratch)
    for name, directive in {
        "run": Run,
        "run-python": RunPython,
        "made": Picture,
        "command-help": CommandHelp,
        "configuration": Configuration,
        "catalogue": Catalogue,
    }.items():
        app.add_directive(name, directive)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
