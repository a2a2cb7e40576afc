"""Writes docs/variables.md, docs/effects.md and docs/drivetrain.md. From evidence/:  python -m pages"""

from pathlib import Path

from gearfmu.files import write_text
from pages import drivetrain
from pages.effects import effects_page
from pages.variables import variables_page

DOCS = Path(__file__).resolve().parents[2] / "docs"

write_text(DOCS / "variables.md", variables_page())
write_text(DOCS / "effects.md", effects_page())
write_text(DOCS / "drivetrain.md", drivetrain.page())
