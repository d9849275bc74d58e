"""The page about a campaign: one self-contained HTML file, readable without a network.

`pendpipe.report.page.render` makes it from the stages' results; the other modules each
prepare one part of it. Nothing is computed here that a stage has not computed before.
"""

import base64
import hashlib
from pathlib import Path
from typing import Final

from markupsafe import Markup

TEMPLATES: Final = Path(__file__).parent / "templates"


def own_files(script_file: str = "script.js") -> dict[str, str]:
    """The package's own style and a script; the policy names the script by its hash."""
    script = (TEMPLATES / script_file).read_text(encoding="utf-8").strip()
    return {
        "style": Markup((TEMPLATES / "style.css").read_text(encoding="utf-8").strip()),
        "script": Markup(script),
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    }
