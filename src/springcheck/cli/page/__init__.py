"""`springcheck report`: a store as one HTML file that needs no server and loads nothing from any network.

`content` gathers what it shows, `writing` fills the template.  The page holds its numbers as text that reads
back as the stored doubles.  Where a scene is one particle on one wall spring, it repeats the loops of three
methods in the reader's browser and compares (`loops.js`).
"""

from springcheck.cli.page.content import Content, gather
from springcheck.cli.page.writing import html, write

__all__ = ["Content", "gather", "html", "write"]
