"""What people are shown: maps as pictures, charts as SVG, figures by name, and the style sheet of both reports."""
