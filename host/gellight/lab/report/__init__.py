"""Pictures and charts for people: maps as pictures, charts as SVG, and the style sheet of both reports."""
