"""What people are shown: maps as pictures, figures by name, and the page of a report."""
