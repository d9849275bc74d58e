"""Igor's text (.itx): waves, and their interval and units below them."""

import re

from pendpipe.formats.plugin import text_dialect


def _lines(lines: list[str]) -> list[str]:
    """Put names, units and interval above."""
    text = "\n".join(lines)
    scale = re.search(r"SetScale */P +x[ ,]+[^,]*,([^,]*),", text)
    said = re.findall(r'SetScale(?: */P)? +[yd][ ,]+[^,]*,[^,]*, *"([^"]+)", *(\w+)', text)
    units = {name: f"{name} ({unit})" for unit, name in said}
    names = "\t".join(units.get(name, name) for name in re.split(r"[,\s]+", lines[1].strip())[1:])
    rows = [line.strip() for line in lines[2:] if not re.match(r"\s*(BEGIN|END|X )", line)]
    return [f"# dt = {scale[1].strip()} s" if scale else "#", names, *rows]


IGOR = text_dialect("file of Igor", re.compile(r"IGOR\s*\nWAVES").match, _lines)
