"""Writes docs/variables.md, docs/effects.md and docs/drivetrain.md: python -m evidence.pages"""

from pathlib import Path

from evidence.pages import drivetrain
from evidence.pages.effects import effects_page
from evidence.pages.variables import variables_page
from gearfmu.files import write_text

DOCS = Path(__file__).resolve().parents[2] / "docs"

write_text(DOCS / "variables.md", variables_page())
write_text(DOCS / "effects.md", effects_page())
write_text(DOCS / "drivetrain.md", drivetrain.page())
